//! Outages of the coordinator itself: while it was down, its machine asleep or its clock set, no worker could
//! renew its lease, so no worker is charged.

/// The correction of all deadlines after an outage of `gap` seconds that ended at `now`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// Seconds by which expired deadlines are moved.
    pub gap: f64,
    /// No deadline is later than this: a clock that was set back would make leases last for hours.
    pub latest: f64,
}

/// The correction due at `now` if leases of `lease_seconds` were last checked at `last_tick`, in seconds of the
/// same clock. Nothing is due after a gap of half a lease or less: a renewal of every healthy worker fits into
/// the rest.
pub fn shift(last_tick: f64, now: f64, lease_seconds: f64) -> Option<Shift> {
    let gap = now - last_tick;
    let regular = (0.0..=lease_seconds / 2.0).contains(&gap);
    (!regular).then_some(Shift {
        gap: gap.max(0.0),
        latest: now + lease_seconds,
    })
}

impl Shift {
    /// The corrected deadline. A deadline that was renewed after the gap stays.
    pub fn apply(&self, deadline: f64, now: f64) -> f64 {
        let moved = if deadline < now {
            deadline + self.gap
        } else {
            deadline
        };
        moved.min(self.latest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lease_has_as_long_to_go_after_an_outage_as_before_it() {
        let (last_tick, now) = (1000.0, 1600.0);
        let shift = shift(last_tick, now, 20.0).expect("ten minutes are an outage");
        assert_eq!(shift.apply(1012.0, now), 1612.0);
        assert_eq!(shift.apply(1615.0, now), 1615.0, "renewed after the outage");
    }

    #[test]
    fn a_clock_that_was_set_back_makes_no_lease_last_for_hours() {
        let (last_tick, now) = (8000.0, 4400.0);
        let shift = shift(last_tick, now, 20.0).expect("backwards is never regular");
        assert_eq!(shift.apply(8012.0, now), 4420.0);
    }

    #[test]
    fn regular_ticks_move_nothing() {
        assert_eq!(shift(1000.0, 1000.0, 20.0), None);
        assert_eq!(shift(1000.0, 1010.0, 20.0), None);
    }
}
