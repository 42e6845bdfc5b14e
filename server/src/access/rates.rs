//! Calls per second of a tenant: a bucket of tokens for each, in this process. Several coordinators admit as many each.

use crate::capacity::{Bucket, Filling};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use yoto_request::RequestError;
use yoto_store::Tenant;

/// Seconds of calls that a tenant who was quiet can make at once: a command asks several things one after the other.
const BURST: f64 = 5.0;
/// Fewest calls of a burst.
const LEAST: f64 = 10.0;

/// The buckets of this process.
#[derive(Debug, Default)]
pub(super) struct Rates {
    buckets: Mutex<HashMap<String, Bucket>>,
}

impl Rates {
    /// Takes a token of the tenant, who may make `rate` calls per second.
    ///
    /// # Errors
    /// When there is none.
    pub(super) fn take(&self, tenant: &Tenant, rate: f64) -> Result<(), RequestError> {
        self.take_at(tenant, rate, Instant::now())
    }

    fn take_at(&self, tenant: &Tenant, rate: f64, now: Instant) -> Result<(), RequestError> {
        let filling = Filling {
            most: (BURST * rate).max(LEAST),
            per_second: rate,
        };
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        let bucket = buckets.entry(tenant.id().to_owned());
        let bucket = bucket.or_insert_with(|| Bucket::full(filling, now));
        match bucket.take(filling, now) {
            true => Ok(()),
            false => Err(RequestError::Busy(format!(
                "the tenant {tenant} may make {rate} calls per second (`calls_per_second` of its quota)"
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_burst_is_followed_by_the_rate() {
        let (rates, now) = (Rates::default(), Instant::now());
        let tenant = Tenant::default();
        let made = |seconds: f64, calls: usize| {
            let at = now + Duration::from_secs_f64(seconds);
            let all = (0..calls).filter(|_| rates.take_at(&tenant, 4.0, at).is_ok());
            all.count()
        };
        assert_eq!(made(0.0, 100), 20);
        assert_eq!(made(1.0, 100), 4);
        assert_eq!(made(1000.0, 100), 20);
        let other = Tenant::new("other").expect("a tenant");
        assert!(
            rates.take_at(&other, 4.0, now).is_ok(),
            "a bucket of its own"
        );
        let error = rates.take_at(&tenant, 4.0, now + Duration::from_secs(1000));
        assert!(
            error
                .expect_err("is empty")
                .to_string()
                .contains("4 calls per second")
        );
    }

    #[test]
    fn a_rate_of_0_ends_all_calls_after_a_burst() {
        let (rates, now) = (Rates::default(), Instant::now());
        let calls = (0..100).filter(|_| rates.take_at(&Tenant::default(), 0.0, now).is_ok());
        assert_eq!(calls.count(), LEAST as usize);
    }
}
