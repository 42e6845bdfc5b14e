//! Epochs of shuffled frames, as in HumanNeRF's data loader: each has every frame of every person once.

use super::FrameIndex;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// The order of all frames, different in each epoch.
pub(crate) struct ByFrame {
    seed: u64,
    epoch: u64,
    /// In the order of the current epoch; never empty.
    frames: Vec<FrameIndex>,
    /// In the order of the lists.
    sorted: Vec<FrameIndex>,
}

impl ByFrame {
    /// The order for subjects with `counts[i]` frames.
    pub(crate) fn new(seed: u64, counts: &[usize]) -> Self {
        let sorted: Vec<FrameIndex> = (0..)
            .zip(counts)
            .flat_map(|(subject, &count)| {
                (0..count).map(move |frame| FrameIndex { subject, frame })
            })
            .collect();
        let mut order = Self {
            seed,
            epoch: 0,
            frames: Vec::new(),
            sorted,
        };
        order.shuffle(0);
        order
    }

    /// The frame of a step.
    ///
    /// # Panics
    /// If there are no frames.
    pub(crate) fn at(&mut self, step: u64) -> FrameIndex {
        let frames = self.sorted.len() as u64;
        let epoch = step / frames;
        if epoch != self.epoch {
            self.shuffle(epoch);
        }
        self.frames[(step % frames) as usize]
    }

    fn shuffle(&mut self, epoch: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // Steps use the streams of their numbers, which never reach these.
        rng.set_stream(u64::MAX - epoch);
        self.frames.clone_from(&self.sorted);
        self.frames.shuffle(&mut rng);
        self.epoch = epoch;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_shows_every_frame_of_everybody_once() {
        let mut order = ByFrame::new(3, &[5, 1, 4]);
        let mut epoch = |first: u64| -> Vec<FrameIndex> {
            (first..first + 10).map(|step| order.at(step)).collect()
        };
        let (one, two) = (epoch(0), epoch(10));
        for frames in [&one, &two] {
            let mut sorted = frames.clone();
            sorted.sort();
            let everybody: Vec<(usize, usize)> = [(0, 5), (1, 1), (2, 4)]
                .into_iter()
                .flat_map(|(subject, count)| (0..count).map(move |frame| (subject, frame)))
                .collect();
            let sorted: Vec<_> = sorted.iter().map(|it| (it.subject, it.frame)).collect();
            assert_eq!(sorted, everybody);
        }
        assert_ne!(one, two, "each epoch has an order of its own");
        assert_eq!(epoch(0), one, "which depends only on the step");
        let other = ByFrame::new(4, &[5, 1, 4]).frames;
        assert_ne!(other, one, "and the seed");
    }
}
