//! MAT-files of version 7.3: HDF5 files with the dimensions in reverse.

use std::path::Path;

use lacuna::plugin::reader::ReadError;

use crate::readers::hdf5::file;
use crate::readers::records::store::{Array, Store};

/// An open file.
pub(super) struct File {
    content: file::File,
    names: Vec<String>,
}

impl File {
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file = file::File::open(path)?;
        // The group `#refs#` holds the elements of cell arrays, without their names.
        let own = file.names().iter().filter(|name| !name.starts_with('#'));
        let names = own.map(|name| name.replace('/', ".")).collect();
        Ok(Self { content: file, names })
    }
}

impl Store for File {
    fn path(&self) -> &Path {
        self.content.path()
    }

    fn format(&self) -> String {
        "MAT-file, version 7.3".to_owned()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn array(&self, name: &str) -> Result<Array, ReadError> {
        let mut array = self.content.array(&name.replace('.', "/"))?;
        array.shape.reverse();
        Ok(Array::from_columns(array.shape, &array.values, array.unit))
    }
}
