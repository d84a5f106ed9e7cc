//! Deserializer of a [`Node`] for serde.

use serde::de::value::{StrDeserializer, StringDeserializer};
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Expected, MapAccess, SeqAccess, VariantAccess,
    Visitor,
};
use serde::forward_to_deserialize_any;

use super::Repairs;
use super::fault::{Cause, Fault, owned};
use super::hole::Hole;
use crate::text::nearest::one_of;
use crate::text::node::{Key, Node, Value};

/// A node being decoded, without the values that have been left out.
#[derive(Clone, Copy)]
pub(super) struct Decoder<'n> {
    node: &'n Node,
    repairs: &'n Repairs,
}

impl<'n> Decoder<'n> {
    pub fn new(node: &'n Node, repairs: &'n Repairs) -> Self {
        Self { node, repairs }
    }

    fn child(self, node: &'n Node) -> Self {
        Self { node, ..self }
    }

    fn wrong(self, expected: &str) -> Fault {
        Fault::wrong(expected, self.node.describe())
    }

    /// Entries that have not been left out.
    fn entries(self) -> impl Iterator<Item = &'n (Key, Node)> {
        let repairs = self.repairs;
        self.node.entries().iter().filter(|(_, node)| !repairs.is_removed(node))
    }

    /// Elements that have not been left out, with their names in a path.
    fn elements(self) -> impl Iterator<Item = (String, &'n Node)> {
        let repairs = self.repairs;
        let named = |(i, node): (usize, &'n Node)| {
            (node.name().map_or_else(|| i.to_string(), str::to_owned), node)
        };
        let kept = move |(_, node): &(usize, &Node)| !repairs.is_removed(node);
        self.node.elements().iter().enumerate().filter(kept).map(named)
    }

    /// A whole number, also if written like `1e3`.
    fn integer(self) -> Result<i64, Fault> {
        match self.node.value {
            Value::Integer(i) => Ok(i),
            Value::Float(x) if x.fract() == 0.0 && x.abs() < 2f64.powi(53) => Ok(x as i64),
            _ => Err(self.wrong("a whole number")),
        }
    }

    fn table(self) -> Result<Table<'n, impl Iterator<Item = &'n (Key, Node)>>, Fault> {
        match self.node.value {
            Value::Table(_) => Ok(Table {
                decoder: self,
                entries: self.entries(),
                holes: self.repairs.holes_of(self.node).map(str::to_owned).collect(),
                current: None,
            }),
            _ => Err(self.wrong("a table")),
        }
    }

    fn structure<'de, V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let table = self.table()?;
        let unknown = self.entries().find(|(key, _)| !fields.contains(&key.name.as_str()));
        if let Some((key, node)) = unknown {
            let cause = Cause::UnknownKey { key: key.name.clone(), known: owned(fields) };
            return Err(Fault::new(cause).at(&key.place).inside(node, Some(&key.name)));
        }
        visitor.visit_map(table)
    }
}

macro_rules! whole_numbers {
    ($($method:ident)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
            match self.integer()? {
                i @ 0.. => visitor.visit_u64(i.unsigned_abs()),
                i => visitor.visit_i64(i),
            }
        }
    )*};
}

impl<'de> Deserializer<'de> for Decoder<'_> {
    type Error = Fault;

    whole_numbers! {
        deserialize_i8 deserialize_i16 deserialize_i32 deserialize_i64
        deserialize_u8 deserialize_u16 deserialize_u32 deserialize_u64
    }

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::String(text) | Value::Datetime(text) => visitor.visit_str(text),
            Value::Integer(i) => visitor.visit_i64(*i),
            Value::Float(x) => visitor.visit_f64(*x),
            Value::Boolean(b) => visitor.visit_bool(*b),
            Value::Array(_) => self.deserialize_seq(visitor),
            Value::Table(_) => visitor.visit_map(self.table()?),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.node.value {
            Value::Boolean(b) => visitor.visit_bool(b),
            _ => Err(self.wrong("`true` or `false`")),
        }
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.node.value {
            Value::Integer(i) => visitor.visit_f64(i as f64),
            Value::Float(x) if x.is_finite() => visitor.visit_f64(x),
            Value::Float(_) => Err(self.wrong("a finite number")),
            _ => Err(self.wrong("a number")),
        }
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_f64(visitor)
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::String(text) | Value::Datetime(text) => visitor.visit_str(text),
            _ => Err(self.wrong("a string")),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_str(visitor)
    }

    fn deserialize_char<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::String(text) if text.chars().count() == 1 => visitor.visit_str(text),
            _ => Err(self.wrong("a single character")),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.node.value {
            Value::Array(_) => {
                visitor.visit_seq(Array { decoder: self, elements: self.elements() })
            }
            _ => Err(self.wrong("an array")),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Fault> {
        let values = |n: usize| if n == 1 { "1 value".into() } else { format!("{n} values") };
        match self.node.value {
            Value::Array(_) => match self.elements().count() {
                given if given == len => self.deserialize_seq(visitor),
                given => Err(Fault::wrong(format!("an array of {}", values(len)), values(given))),
            },
            _ => Err(self.wrong(&format!("an array of {}", values(len)))),
        }
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.deserialize_tuple(len, visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        if let Value::Table(_) = self.node.value {
            return visitor.visit_map(self.table()?);
        }
        // A visitor of its own says more than that of a map of any keys.
        let said = (&visitor as &dyn Expected).to_string();
        Err(self.wrong(if said == "a map" { "a table" } else { &said }))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.structure(fields, visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let mut entries = self.entries();
        let (name, content) = match (&self.node.value, entries.next(), entries.next()) {
            (Value::String(name), ..) => (name, None),
            (Value::Table(_), Some((key, node)), None) => (&key.name, Some((key, node))),
            (Value::Table(_), first, _) => {
                let found = first.map_or("an empty table", |_| "more than one key");
                let expected = format!("one of the keys {}", one_of(variants.iter().copied()));
                return Err(Fault::wrong(expected, found));
            }
            _ => {
                let expected = format!("one of {}", one_of(variants.iter().copied()));
                return Err(self.wrong(&expected));
            }
        };
        visitor.visit_enum(Choice { decoder: self, name, content })
    }

    forward_to_deserialize_any! { bytes byte_buf unit unit_struct identifier ignored_any }
}

struct Table<'n, I> {
    decoder: Decoder<'n>,
    entries: I,
    holes: Vec<String>,
    current: Option<&'n (Key, Node)>,
}

impl<'de, 'n, I: Iterator<Item = &'n (Key, Node)>> MapAccess<'de> for Table<'n, I> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Fault> {
        self.current = self.entries.next();
        if let Some((key, node)) = self.current {
            let named = seed.deserialize(StrDeserializer::new(&key.name));
            return named
                .map(Some)
                .map_err(|fault: Fault| fault.at(&key.place).inside(node, Some(&key.name)));
        }
        self.holes.pop().map(|key| seed.deserialize(StringDeserializer::new(key))).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Fault> {
        match self.current {
            Some((key, node)) => seed
                .deserialize(self.decoder.child(node))
                .map_err(|fault| fault.inside(node, Some(&key.name))),
            None => seed.deserialize(Hole::new()).map_err(|_| Fault::new(Cause::Hole)),
        }
    }
}

struct Array<'n, I> {
    decoder: Decoder<'n>,
    elements: I,
}

impl<'de, 'n, I: Iterator<Item = (String, &'n Node)>> SeqAccess<'de> for Array<'n, I> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Fault> {
        let Some((name, node)) = self.elements.next() else { return Ok(None) };
        seed.deserialize(self.decoder.child(node))
            .map(Some)
            .map_err(|fault| fault.inside(node, Some(&name)))
    }
}

/// An enum: a name alone, or a table whose only key is the name.
struct Choice<'n> {
    decoder: Decoder<'n>,
    name: &'n str,
    content: Option<(&'n Key, &'n Node)>,
}

impl<'n> Choice<'n> {
    /// Passes the content under the name to `decode`.
    ///
    /// # Errors
    /// If the name stands alone.
    fn with_content<T>(
        &self,
        decode: impl FnOnce(Decoder<'n>) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        let Some((key, node)) = self.content else {
            let expected = format!("`{}` with its value", self.name);
            let help = format!("write `{{ {} = … }}`", self.name);
            return Err(Fault::wrong(expected, "the name alone").help(help));
        };
        decode(self.decoder.child(node)).map_err(|fault| fault.inside(node, Some(&key.name)))
    }
}

impl<'de> EnumAccess<'de> for Choice<'_> {
    type Error = Fault;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Fault> {
        let name = StrDeserializer::new(self.name);
        let place = self.content.map_or(&self.decoder.node.place, |(key, _)| &key.place);
        let variant = seed.deserialize(name).map_err(|fault: Fault| fault.at(place))?;
        Ok((variant, self))
    }
}

impl<'de> VariantAccess<'de> for Choice<'_> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        match self.content {
            None => Ok(()),
            Some((_, Node { value: Value::Table(entries), .. })) if entries.is_empty() => Ok(()),
            Some((key, node)) => {
                let fault = Fault::wrong(format!("`{}` alone", self.name), node.describe());
                let help = format!("write `\"{}\"`", self.name);
                Err(fault.help(help).inside(node, Some(&key.name)))
            }
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Fault> {
        self.with_content(|decoder| seed.deserialize(decoder))
    }

    fn tuple_variant<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Fault> {
        self.with_content(|decoder| decoder.deserialize_tuple(len, visitor))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        if self.content.is_some() {
            return self.with_content(|decoder| decoder.structure(fields, visitor));
        }
        // A name alone means the defaults of the variant.
        let empty = Node::table(self.decoder.node.place.clone());
        let nothing = Repairs::default();
        Decoder::new(&empty, &nothing).structure(fields, visitor).map_err(|fault| {
            let Cause::Missing(key) = &fault.cause else { return fault };
            let expected = format!("`{}` with its keys", self.name);
            let help = format!("write `{{ {} = {{ {key} = … }} }}`", self.name);
            Fault::wrong(expected, "the name alone").help(help)
        })
    }
}
