//! The order of the faults, by a seed.

use super::fault::Fault;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Faults that last from the first call to the last: the coordinator makes them by itself.
const CONSTANT: [Fault; 4] = [
    Fault::CallRepeated,
    Fault::CallLate,
    Fault::AnswerLost,
    Fault::HintLost,
];

/// The sequence of faults: each kind once, in a seeded random order, then any kind.
#[derive(Debug)]
pub(crate) struct Plan {
    chance: ChaCha8Rng,
    kinds: Vec<Fault>,
    /// Kinds of the first round that are still to come.
    first: Vec<Fault>,
}

impl Plan {
    /// The plan of a seed, with these kinds.
    pub(crate) fn new(seed: u64, mut kinds: Vec<Fault>) -> Self {
        let mut chance = ChaCha8Rng::seed_from_u64(seed);
        kinds.retain(|fault| !CONSTANT.contains(fault));
        let mut first = kinds.clone();
        for last in (1..first.len()).rev() {
            first.swap(last, chance.random_range(0..=last));
        }
        Self {
            chance,
            kinds,
            first,
        }
    }

    /// Whether each kind has happened once.
    pub(crate) fn is_complete(&self) -> bool {
        self.first.is_empty()
    }
}

impl Iterator for Plan {
    type Item = Fault;

    fn next(&mut self) -> Option<Fault> {
        let any = self.chance.random_range(0..self.kinds.len());
        self.first.pop().or_else(|| self.kinds.get(any).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_seed_gives_each_kind_once_and_always_in_the_same_order() {
        let rounds = Fault::ALL.len() - CONSTANT.len();
        let plan = |seed| Plan::new(seed, Fault::ALL.to_vec());
        let (again, other) = (plan(3), plan(4));
        let mut plan = plan(3);
        let first: Vec<_> = plan.by_ref().take(rounds).collect();
        assert!(plan.is_complete());
        assert_eq!(first.iter().collect::<BTreeSet<_>>().len(), rounds);
        let again: Vec<_> = again.take(rounds).collect();
        assert_eq!(first, again);
        let other: Vec<_> = other.take(rounds).collect();
        assert_ne!(first, other);
    }
}
