//! A bucket of tokens: a number of events at once, and then a number per second.

use std::time::Instant;

/// The tokens of one owner.
#[derive(Debug)]
pub(crate) struct Bucket {
    tokens: f64,
    at: Instant,
}

/// How buckets fill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Filling {
    /// Tokens of a full bucket.
    pub most: f64,
    /// Tokens that come per second.
    pub per_second: f64,
}

impl Bucket {
    /// A full one.
    pub(crate) fn full(filling: Filling, now: Instant) -> Self {
        Self {
            tokens: filling.most,
            at: now,
        }
    }

    /// Whether there is a token now.
    pub(crate) fn has(&mut self, filling: Filling, now: Instant) -> bool {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.tokens = (self.tokens + passed * filling.per_second).min(filling.most);
        self.at = now;
        self.tokens >= 1.0
    }

    /// Takes a token. The number may fall below zero.
    pub(crate) fn spend(&mut self) {
        self.tokens -= 1.0;
    }

    /// Takes a token if there is one.
    pub(crate) fn take(&mut self, filling: Filling, now: Instant) -> bool {
        let has = self.has(filling, now);
        if has {
            self.spend();
        }
        has
    }

    /// Whether it is full, so that nothing is lost if it is forgotten.
    pub(crate) fn is_full(&mut self, filling: Filling, now: Instant) -> bool {
        self.has(filling, now);
        self.tokens >= filling.most
    }
}
