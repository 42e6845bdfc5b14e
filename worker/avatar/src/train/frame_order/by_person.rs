//! Turns of people: everybody once per round in a shuffled order, or those with a higher loss more often.

use super::{FramePlace, Practice, series};
use rand::RngExt;
use rand::seq::SliceRandom;

/// Series of the rounds' orders, and of draws by loss; those of people's frames follow.
const ROUNDS: u64 = 0;
const DRAWS: u64 = 1;
const FRAMES: u64 = 2;

/// The order of people, and of each one's frames.
pub struct ByPerson {
    seed: u64,
    /// Exponent of the loss in a person's share of the steps; 0: equal shares.
    harder: f64,
    people: Shuffled,
    frames: Vec<Shuffled>,
}

impl ByPerson {
    /// The order for people with `counts[i]` frames, at least one each.
    pub fn new(seed: u64, counts: &[usize], harder: f64) -> Self {
        let frames = (FRAMES..).zip(counts);
        Self {
            seed,
            harder,
            people: Shuffled::new(seed, ROUNDS, counts.len()),
            frames: frames
                .map(|(person, &count)| Shuffled::new(seed, person, count))
                .collect(),
        }
    }

    /// The frame of a step: of the person whose turn it is, the one after those of their earlier steps.
    ///
    /// # Panics
    /// If there are no people, or `practice` has another number of them.
    pub fn place(&mut self, step: u64, practice: &[Practice]) -> FramePlace {
        let subject = match self.harder > 0.0 {
            true => self.drawn(step, practice),
            false => self.people.at(step),
        };
        let frame = self.frames[subject].at(practice[subject].steps);
        FramePlace { subject, frame }
    }

    /// A person drawn with a probability proportional to the power of their loss. Somebody without a loss
    /// counts as the hardest.
    fn drawn(&self, step: u64, practice: &[Practice]) -> usize {
        let known = practice.iter().filter_map(|it| it.loss);
        let hardest = known.fold(f64::MIN_POSITIVE, f64::max);
        let weights: Vec<f64> = practice
            .iter()
            .map(|it| (it.loss.unwrap_or(hardest) / hardest).powf(self.harder))
            .collect();
        let sum: f64 = weights.iter().sum();
        let mut left = series(self.seed, DRAWS, step).random::<f64>() * sum;
        let chosen = weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        // Rounding may leave a rest after the last one.
        chosen.unwrap_or(weights.len() - 1)
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

    /// The number at `turn`.
    fn at(&mut self, turn: u64) -> usize {
        let count = self.order.len() as u64;
        if turn / count != self.epoch {
            self.shuffle(turn / count);
        }
        self.order[(turn % count) as usize]
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

    /// The places of `steps` steps, of which person `i` has the loss `losses[i]`.
    fn places(order: &mut ByPerson, losses: &[f64], steps: u64) -> Vec<FramePlace> {
        let mut practice = vec![Practice::default(); losses.len()];
        let step = |step| {
            let place = order.place(step, &practice);
            practice[place.subject].note(Some(losses[place.subject]));
            place
        };
        (0..steps).map(step).collect()
    }

    fn steps_of(places: &[FramePlace], subject: usize) -> Vec<usize> {
        let own = places.iter().filter(|it| it.subject == subject);
        own.map(|it| it.frame).collect()
    }

    #[test]
    fn everybody_has_as_many_steps_however_short_their_film() {
        let counts = [5, 1, 10];
        let places = places(&mut ByPerson::new(3, &counts, 0.0), &[1.0; 3], 30);
        for round in places.chunks(3) {
            let mut subjects: Vec<usize> = round.iter().map(|it| it.subject).collect();
            subjects.sort_unstable();
            assert_eq!(subjects, [0, 1, 2]);
        }
        for (subject, count) in counts.into_iter().enumerate() {
            let frames = steps_of(&places, subject);
            for epoch in frames.chunks(count) {
                let mut epoch = epoch.to_vec();
                epoch.sort_unstable();
                assert!(epoch.into_iter().eq(0..count), "each frame once");
            }
        }
        let frames = steps_of(&places, 0);
        assert_ne!(
            frames[..5],
            frames[5..],
            "each epoch has an order of its own"
        );
    }

    #[test]
    fn a_resumed_order_is_that_of_an_uninterrupted_one() {
        let whole = places(&mut ByPerson::new(3, &[5, 2], 1.0), &[0.2, 0.6], 40);
        let mut practice = [Practice::default(); 2];
        let mut order = ByPerson::new(3, &[5, 2], 1.0);
        for (step, expected) in (0..).zip(whole) {
            if step % 7 == 0 {
                order = ByPerson::new(3, &[5, 2], 1.0);
            }
            let place = order.place(step, &practice);
            assert_eq!(place, expected);
            practice[place.subject].note(Some([0.2, 0.6][place.subject]));
        }
    }

    #[test]
    fn harder_people_get_more_steps() {
        let losses = [0.1, 0.3];
        let share = |harder: f64| {
            let places = places(&mut ByPerson::new(5, &[4, 4], harder), &losses, 2000);
            steps_of(&places, 1).len() as f64 / 2000.0
        };
        assert_eq!(share(0.0), 0.5);
        assert!((share(1.0) - 0.75).abs() < 0.03, "{}", share(1.0));
        assert!((share(2.0) - 0.9).abs() < 0.03, "{}", share(2.0));
    }

    #[test]
    fn a_loss_of_zero_leaves_the_others_their_turns() {
        let places = places(&mut ByPerson::new(5, &[4, 4], 1.0), &[0.0, 0.0], 20);
        assert!(places.iter().all(|it| it.subject < 2));
    }
}
