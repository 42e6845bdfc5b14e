//! `yoto usage` and `yoto quota`: what tenants use of a service that they share.

mod amount;
mod quota;
mod usage;

pub(crate) use quota::SetQuota;
pub(crate) use usage::ShowUsage;
