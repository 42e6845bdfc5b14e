//! Steps of the clock: it was set, the machine slept, or the service was down. Ages count only the service's running
//! time, so a step never deletes anything.

/// Smallest difference from the steady clock that is a step, seconds: far above the time between the two readings, and
/// far below any time after which something is deleted.
const TOLERANCE: f64 = 1.0;

/// Readings of both clocks at one moment, seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// [`Clock::now`](crate::clock::Clock::now), since 1970.
    pub now: f64,
    /// [`Clock::steady`](crate::clock::Clock::steady), since some moment of this process.
    pub steady: f64,
}

/// A step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Latest time stamp that was made before the step.
    pub at: f64,
    /// How far the clock moved ahead; negative if it was set back.
    pub seconds: f64,
}

impl Reading {
    /// The time at `steady` if the clock was not set since this reading.
    pub fn expected(&self, steady: f64) -> f64 {
        self.now + (steady - self.steady)
    }

    /// The step between this reading and a `later` one of the same process.
    pub fn step_to(&self, later: Self) -> Option<Step> {
        let expected = self.expected(later.steady);
        let seconds = later.now - expected;
        (seconds.abs() > TOLERANCE).then_some(Step {
            // After a step back, stamps from before and after can be equal: those count as made after it.
            at: expected.min(later.now),
            seconds,
        })
    }
}

/// The step at the start of a process at `now`, if the previous one last checked at `last_tick`. All stamps are older.
pub fn while_down(last_tick: f64, now: f64) -> Option<Step> {
    let seconds = now - last_tick;
    (seconds.abs() > TOLERANCE).then_some(Step { at: now, seconds })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: Reading = Reading {
        now: 1000.0,
        steady: 5.0,
    };

    fn step(now: f64, steady: f64) -> Option<Step> {
        FIRST.step_to(Reading { now, steady })
    }

    #[test]
    fn passing_time_is_no_step() {
        assert_eq!(step(1000.0, 5.0), None);
        assert_eq!(step(90_000.2, 89_005.0), None);
    }

    #[test]
    fn a_clock_that_is_set_steps_by_its_difference_from_the_steady_one() {
        let ahead = Step {
            at: 1010.0,
            seconds: 86_400.0,
        };
        assert_eq!(step(87_410.0, 15.0), Some(ahead));
        let back = Step {
            at: 910.0,
            seconds: -100.0,
        };
        assert_eq!(step(910.0, 15.0), Some(back));
    }

    #[test]
    fn time_while_the_service_is_down_is_a_step() {
        let down = Step {
            at: 5000.0,
            seconds: 4000.0,
        };
        assert_eq!(while_down(1000.0, 5000.0), Some(down));
        assert_eq!(while_down(1000.0, 1000.5), None);
    }
}
