//! Placeholder for a missing value, so that the rest of a table can still be checked.

use serde::de::value::{SeqDeserializer, StrDeserializer};
use serde::de::{DeserializeSeed, Deserializer, EnumAccess, MapAccess, VariantAccess, Visitor};
use serde::forward_to_deserialize_any;

use super::fault::{Cause, Fault};

/// Decodes to a harmless value of whatever type is requested.
#[derive(Clone, Copy)]
pub(super) struct Hole {
    depth: usize,
}

impl Hole {
    /// Depth at which filling stops, because a type may contain itself.
    const DEEPEST: usize = 8;

    pub fn new() -> Self {
        Self { depth: 0 }
    }

    fn deeper(self) -> Result<Self, Fault> {
        if self.depth == Self::DEEPEST {
            return Err(Fault::new(Cause::Hole));
        }
        Ok(Self { depth: self.depth + 1 })
    }
}

macro_rules! harmless {
    ($($method:ident => $visit:ident($value:expr),)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
            visitor.$visit($value)
        }
    )*};
}

impl<'de> Deserializer<'de> for Hole {
    type Error = Fault;

    // 0.5 is valid as a probability, a fraction and a positive number.
    harmless! {
        deserialize_bool => visit_bool(false),
        deserialize_i64 => visit_i64(1),
        deserialize_u64 => visit_u64(1),
        deserialize_f64 => visit_f64(0.5),
        deserialize_str => visit_str("name"),
        deserialize_string => visit_str("name"),
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Fault> {
        Err(Fault::new(Cause::Hole))
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_u64(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_none()
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_seq(SeqDeserializer::new(std::iter::empty::<HoleValue>()))
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Fault> {
        let hole = self.deeper()?;
        visitor.visit_seq(SeqDeserializer::new(std::iter::repeat_n(HoleValue(hole), len)))
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_map(Fields { names: [].iter(), hole: self.deeper()? })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_map(Fields { names: fields.iter(), hole: self.deeper()? })
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let first = variants.first().ok_or_else(|| Fault::new(Cause::Hole))?;
        visitor.visit_enum(Variant { name: first, hole: self.deeper()? })
    }

    forward_to_deserialize_any! {
        i8 i16 i32 u8 u16 f32 char bytes byte_buf unit unit_struct tuple_struct identifier
        ignored_any
    }
}

#[derive(Clone, Copy)]
struct HoleValue(Hole);

impl serde::de::IntoDeserializer<'_, Fault> for HoleValue {
    type Deserializer = Hole;

    fn into_deserializer(self) -> Hole {
        self.0
    }
}

struct Fields {
    names: std::slice::Iter<'static, &'static str>,
    hole: Hole,
}

impl<'de> MapAccess<'de> for Fields {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Fault> {
        self.names.next().map(|name| seed.deserialize(StrDeserializer::new(name))).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Fault> {
        seed.deserialize(self.hole)
    }
}

struct Variant {
    name: &'static str,
    hole: Hole,
}

impl<'de> EnumAccess<'de> for Variant {
    type Error = Fault;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Fault> {
        Ok((seed.deserialize(StrDeserializer::new(self.name))?, self))
    }
}

impl<'de> VariantAccess<'de> for Variant {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Fault> {
        seed.deserialize(self.hole)
    }

    fn tuple_variant<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Fault> {
        self.hole.deserialize_tuple(len, visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.hole.deserialize_struct("", fields, visitor)
    }
}
