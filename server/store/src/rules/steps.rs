//! Steps of the clock: it was set, the machine slept, or the service was down. Ages count only the service's running
//! time, so a step never deletes anything.
//!
//! [`outage`](super::outage) answers another question: whether workers could renew their leases. They could not while the
//! service was up but its database was not, which is running time; and they lose nothing by a step of a few seconds.

/// Smallest difference from the steady clock that is a step, seconds: far above the time between the two readings, and
/// far below any time after which something is deleted.
const TOLERANCE: f64 = 1.0;

/// Readings of both clocks at one moment, seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// [`Clock::now`](yoto_process::clock::Clock::now), since 1970.
    pub now: f64,
    /// [`Clock::steady`](yoto_process::clock::Clock::steady), since some moment of this process.
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

/// The step between the check at `last` by another coordinator of the same database, which recorded earlier steps, and a
/// reading, if the `previous` reading of this process was before that check. A step back by less than the time since
/// `previous` is not found: nothing shows how much of that time has passed since the check.
pub fn since_another(last: f64, previous: Reading, later: Reading) -> Option<Step> {
    let most = later.steady - previous.steady;
    let passed = later.now - last;
    let seconds = passed - passed.clamp(0.0, most);
    (seconds.abs() > TOLERANCE).then_some(Step {
        at: (last + most).min(later.now),
        seconds,
    })
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
    fn a_step_that_another_coordinator_has_recorded_is_none() {
        let later = |now| Reading { now, steady: 15.0 };
        // The clock was set ahead by a day, and the other one's check was 4 s ago.
        assert_eq!(since_another(87_406.0, FIRST, later(87_410.0)), None);
        // It was set after that check.
        let ahead = since_another(1006.0, FIRST, later(87_416.0));
        let expected = Step {
            at: 1016.0,
            seconds: 86_400.0,
        };
        assert_eq!(ahead, Some(expected));
        let back = since_another(1006.0, FIRST, later(906.0));
        let expected = Step {
            at: 906.0,
            seconds: -100.0,
        };
        assert_eq!(back, Some(expected));
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
