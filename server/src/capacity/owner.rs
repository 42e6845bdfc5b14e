//! Who holds places of a pool.

use std::fmt;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

/// The owner of a place.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Owner {
    /// An address of the network. An IPv6 address stands for its /64, all of which one customer of a provider has (RFC 6177).
    Address(IpAddr),
    /// The tenant with this id.
    Tenant(Arc<str>),
    /// The key with this id. It has half of its tenant's share, so that one key does not stop the tenant's others.
    Key(Arc<str>),
    /// The webhook with this id, as a key.
    Webhook(Arc<str>),
}

impl Owner {
    /// The owner with this address.
    pub(crate) fn at(address: IpAddr) -> Self {
        match address.to_canonical() {
            IpAddr::V6(ip) => {
                let network = ip.to_bits() & (u128::MAX << 64);
                Self::Address(Ipv6Addr::from_bits(network).into())
            }
            v4 @ IpAddr::V4(_) => Self::Address(v4),
        }
    }

    /// The places that it may hold while `free` are free.
    pub(super) fn share_of(&self, free: usize) -> usize {
        match self {
            Self::Address(_) | Self::Tenant(_) => free,
            Self::Key(_) | Self::Webhook(_) => free.div_ceil(2),
        }
    }
}

impl fmt::Display for Owner {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address(address) => write!(out, "the address {address}"),
            Self::Tenant(tenant) => write!(out, "the tenant {tenant}"),
            Self::Key(key) => write!(out, "the key {key}"),
            Self::Webhook(webhook) => write!(out, "the webhook {webhook}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_of_ipv6_stands_for_its_network() {
        let at = |text: &str| Owner::at(text.parse().expect("an address"));
        assert_eq!(at("2001:db8:1:2:3:4:5:6"), at("2001:db8:1:2::1"));
        assert_ne!(at("2001:db8:1:2::1"), at("2001:db8:1:3::1"));
        assert_eq!(at("::ffff:192.0.2.1"), at("192.0.2.1"));
        assert_ne!(at("192.0.2.1"), at("192.0.2.2"));
    }
}
