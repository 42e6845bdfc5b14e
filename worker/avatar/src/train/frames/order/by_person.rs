//! Rounds of people: everybody once per round, in a shuffled order.

use super::{FrameIndex, PersonSteps, series};
use rand::seq::SliceRandom;

/// Series of the rounds' orders.
const ROUNDS: u64 = 0;
/// First series of the orders of people's frames; checkpoints depend on its number.
const FRAMES: u64 = 2;

/// The order of people, and of each one's frames.
pub(crate) struct ByPerson {
    people: Shuffled,
    frames: Vec<Shuffled>,
}

impl ByPerson {
    /// The order for people with `counts[i]` frames, at least one each.
    pub(crate) fn new(seed: u64, counts: &[usize]) -> Self {
        let frames = (FRAMES..).zip(counts);
        Self {
            people: Shuffled::new(seed, ROUNDS, counts.len()),
            frames: frames
                .map(|(person, &count)| Shuffled::new(seed, person, count))
                .collect(),
        }
    }

    /// The frame of a step: the next of the next person.
    ///
    /// # Panics
    /// If there are no people, or `steps_per_person` has another number of them.
    pub(crate) fn at(&mut self, step: u64, steps_per_person: &[PersonSteps]) -> FrameIndex {
        let subject = self.people.at(step);
        let frame = self.frames[subject].at(steps_per_person[subject].steps);
        FrameIndex { subject, frame }
    }
}

/// The numbers below a count again and again, each time in another order.
struct Shuffled {
    seed: u64,
    series: u64,
    epoch: u64,
    order: Vec<usize>,
}

impl Shuffled {
    fn new(seed: u64, series: u64, count: usize) -> Self {
        let mut shuffled = Self {
            seed,
            series,
            epoch: 0,
            order: (0..count).collect(),
        };
        shuffled.shuffle(0);
        shuffled
    }

    /// The number at `index` of the series.
    fn at(&mut self, index: u64) -> usize {
        let count = self.order.len() as u64;
        if index / count != self.epoch {
            self.shuffle(index / count);
        }
        self.order[(index % count) as usize]
    }

    fn shuffle(&mut self, epoch: u64) {
        self.order.sort_unstable();
        let mut rng = series(self.seed, self.series, epoch);
        self.order.shuffle(&mut rng);
        self.epoch = epoch;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The frames of `steps` steps with `people` people.
    fn frames(order: &mut ByPerson, people: usize, steps: u64) -> Vec<FrameIndex> {
        let mut steps_per_person = vec![PersonSteps::default(); people];
        let step = |step| {
            let index = order.at(step, &steps_per_person);
            steps_per_person[index.subject].steps += 1;
            index
        };
        (0..steps).map(step).collect()
    }

    fn steps_of(order: &[FrameIndex], subject: usize) -> Vec<usize> {
        let own = order.iter().filter(|it| it.subject == subject);
        own.map(|it| it.frame).collect()
    }

    #[test]
    fn everybody_has_equal_steps_however_short_their_film() {
        let counts = [5, 1, 10];
        let order = frames(&mut ByPerson::new(3, &counts), 3, 30);
        for round in order.chunks(3) {
            let mut subjects: Vec<usize> = round.iter().map(|it| it.subject).collect();
            subjects.sort_unstable();
            assert_eq!(subjects, [0, 1, 2]);
        }
        for (subject, count) in counts.into_iter().enumerate() {
            let frames = steps_of(&order, subject);
            for epoch in frames.chunks(count) {
                let mut epoch = epoch.to_vec();
                epoch.sort_unstable();
                assert!(epoch.into_iter().eq(0..count), "each frame once");
            }
        }
        let frames = steps_of(&order, 0);
        assert_ne!(
            frames[..5],
            frames[5..],
            "each epoch has an order of its own"
        );
    }

    #[test]
    fn a_resumed_order_is_that_of_an_uninterrupted_one() {
        let whole = frames(&mut ByPerson::new(3, &[5, 2]), 2, 40);
        let mut steps_per_person = [PersonSteps::default(); 2];
        let mut order = ByPerson::new(3, &[5, 2]);
        for (step, expected) in (0..).zip(whole) {
            if step % 7 == 0 {
                order = ByPerson::new(3, &[5, 2]);
            }
            let index = order.at(step, &steps_per_person);
            assert_eq!(index, expected);
            steps_per_person[index.subject].steps += 1;
        }
    }
}
