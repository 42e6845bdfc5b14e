//! Steps of the clock: it was set, the machine slept, or the service was down. What is deleted after a time is deleted
//! after time that the service spent, whatever the clock says.

/// Difference from the steady clock that is a step, seconds: far above what two readings one after the other differ by,
/// far below any time after which something is deleted.
const TOLERANCE: f64 = 1.0;

/// Both clocks at one moment, in seconds: the one that can be set, and the steady one of this process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Since 1970.
    pub now: f64,
    /// Since a moment of this process.
    pub steady: f64,
}

/// A step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// No time stamp after this one was made before the step.
    pub at: f64,
    /// By how much the clock moved ahead; below 0: it was set back.
    pub seconds: f64,
}

impl Reading {
    /// What the clock would show at `steady` if nobody had set it since.
    pub fn expected(&self, steady: f64) -> f64 {
        self.now + (steady - self.steady)
    }

    /// The step between this reading and a `later` one of the same process.
    pub fn step_to(&self, later: Self) -> Option<Step> {
        let expected = self.expected(later.steady);
        let seconds = later.now - expected;
        (seconds.abs() > TOLERANCE).then_some(Step {
            // After a step back, stamps of both sides can be equal: those in doubt count as made after it.
            at: expected.min(later.now),
            seconds,
        })
    }
}

/// The step at the start of a process at `now` after one that last looked at `last_tick`. All stamps are from before.
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
    fn time_that_passes_is_no_step() {
        assert_eq!(step(1000.0, 5.0), None);
        assert_eq!(step(90_000.2, 89_005.0), None);
    }

    #[test]
    fn a_clock_that_is_set_steps_by_what_no_time_explains() {
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
    fn a_service_that_was_down_spent_no_time() {
        let down = Step {
            at: 5000.0,
            seconds: 4000.0,
        };
        assert_eq!(while_down(1000.0, 5000.0), Some(down));
        assert_eq!(while_down(1000.0, 1000.5), None);
    }
}
