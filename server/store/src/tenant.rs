//! Tenants: whoever shares a service without seeing each other.
//!
//! Every request is made for one tenant, which the layer of access puts into the request's extensions: that of the caller's key. A
//! service has the tenant `default` only, until someone adds others: a newcomer never sees it. A name of another tenant's
//! resource is answered like one that does not exist.

use std::fmt;
use std::sync::Arc;

/// The tenant of a service without tenants.
const DEFAULT: &str = "default";

/// The id of a tenant: every access of a user to the store is limited to it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Tenant(Arc<str>);

impl Default for Tenant {
    fn default() -> Self {
        Self(DEFAULT.into())
    }
}

impl fmt::Display for Tenant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Tenant {
    /// The tenant with this id; `None` unless it is 1 to 64 of `[a-z0-9-]`, as in resource names.
    pub fn new(id: &str) -> Option<Self> {
        let valid = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        ((1..=64).contains(&id.len()) && id.bytes().all(valid)).then(|| Self(id.into()))
    }

    /// The id.
    pub fn id(&self) -> &str {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_has_the_alphabet_of_names() {
        assert_eq!(Tenant::new("default"), Some(Tenant::default()));
        for bad in ["", "A", "a/b", "a b", &"a".repeat(65)] {
            assert_eq!(Tenant::new(bad), None, "{bad}");
        }
    }
}
