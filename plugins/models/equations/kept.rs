//! Compiled equations, kept from call to call.

use std::sync::{Arc, PoisonError, RwLock};

use super::system::{Located, Names, System};

/// How many are kept: more than a study has scenarios, as a rule.
const MOST: usize = 64;

/// Systems by the names they were compiled for. It is no part of the options: copies begin empty, and all are equal.
#[derive(Debug, Default)]
pub struct Kept(RwLock<Vec<(Names, Arc<System>)>>);

impl Kept {
    /// The system for these names.
    pub fn get(
        &self,
        names: &Names,
        compile: impl FnOnce() -> Result<System, Vec<Located>>,
    ) -> Result<Arc<System>, Vec<Located>> {
        let same = |kept: &&(Names, Arc<System>)| same(&kept.0, names);
        let list = self.0.read().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, system)) = list.iter().find(same) {
            return Ok(system.clone());
        }
        drop(list);
        let system = Arc::new(compile()?);
        let mut list = self.0.write().unwrap_or_else(PoisonError::into_inner);
        if list.len() >= MOST {
            list.remove(0);
        }
        list.push((names.clone(), system.clone()));
        Ok(system)
    }
}

/// Whether the names are the same; tables only where they are shared, as comparing long ones is dear.
fn same(a: &Names, b: &Names) -> bool {
    a.variables == b.variables
        && a.inputs == b.inputs
        && a.functions.len() == b.functions.len()
        && a.functions.iter().zip(&b.functions).all(|(a, b)| Arc::ptr_eq(a, b))
}

impl Clone for Kept {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for Kept {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
