//! The pose that an actor of a scene has at a time.

/// Share of an interval below which it counts as 0: frame rates are rounded.
const ROUNDING: f64 = 1e-3;

/// Times of the poses of a motion within a scene.
pub(super) struct Clock {
    /// Of each pose since the first one, seconds, increasing; at least one.
    pub(super) seconds: Vec<f64>,
    /// Beginning of the motion in the scene, seconds.
    pub(super) start: f64,
    /// Seconds of the motion per second of the scene.
    pub(super) speed: f64,
    /// Whether the motion begins again after its end.
    pub(super) repeat: bool,
}

/// A moment of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    /// The last pose before it, or at it.
    pub(super) pose: usize,
    /// Share of the way to the next pose, below 1.
    pub(super) share: f64,
}

impl Clock {
    fn last(&self) -> f64 {
        self.seconds.last().copied().unwrap_or_default()
    }

    /// Mean time between two poses, seconds; 0 for a single one.
    pub(super) fn interval(&self) -> f64 {
        self.last() / (self.seconds.len() as f64 - 1.0).max(1.0)
    }

    /// Seconds of the motion until it begins again, its last pose included.
    fn period(&self) -> f64 {
        self.last() + self.interval()
    }

    /// End of the motion in the scene, seconds; of its first round if it repeats.
    pub(super) fn end(&self) -> f64 {
        let passed = match self.repeat {
            true => self.period(),
            false => self.last(),
        };
        self.start + passed / self.speed
    }

    /// The moment of the motion at `seconds` of the scene.
    pub(super) fn at(&self, seconds: f64) -> Moment {
        let mut passed = ((seconds - self.start) * self.speed).max(0.0);
        if self.repeat && self.period() > 0.0 {
            passed %= self.period();
        }
        let pose = self.seconds.partition_point(|it| *it <= passed).max(1) - 1;
        let share = match (self.seconds.get(pose), self.seconds.get(pose + 1)) {
            (Some(here), Some(next)) => (passed - here) / (next - here),
            _ => 0.0,
        };
        if share > 1.0 - ROUNDING {
            Moment {
                pose: pose + 1,
                share: 0.0,
            }
        } else if share < ROUNDING {
            Moment { pose, share: 0.0 }
        } else {
            Moment { pose, share }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(repeat: bool) -> Clock {
        Clock {
            seconds: vec![0.0, 1.0, 2.0],
            start: 0.5,
            speed: 2.0,
            repeat,
        }
    }

    fn at(clock: &Clock, seconds: f64) -> (usize, f64) {
        let Moment { pose, share } = clock.at(seconds);
        (pose, share)
    }

    #[test]
    fn an_actor_waits_moves_at_their_speed_and_stays() {
        let clock = clock(false);
        assert_eq!(at(&clock, 0.0), (0, 0.0));
        assert_eq!(at(&clock, 0.75), (0, 0.5));
        assert_eq!(at(&clock, 1.0), (1, 0.0));
        assert_eq!(at(&clock, 1.5), (2, 0.0));
        assert_eq!(at(&clock, 9.0), (2, 0.0));
        for rounded in [0.999_999_99, 1.000_000_01] {
            assert_eq!(at(&clock, rounded), (1, 0.0));
        }
        assert_eq!(clock.end(), 1.5);
    }

    #[test]
    fn a_repeated_motion_begins_again_one_interval_after_its_last_pose() {
        let clock = clock(true);
        assert_eq!(clock.end(), 2.0);
        assert_eq!(at(&clock, 1.9), (2, 0.0));
        assert_eq!(at(&clock, 2.0), (0, 0.0));
        assert_eq!(at(&clock, 2.25), (0, 0.5));
        let still = Clock {
            seconds: vec![0.0],
            ..clock
        };
        assert_eq!((at(&still, 7.0), still.end()), ((0, 0.0), 0.5));
    }
}
