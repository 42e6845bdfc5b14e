//! The table at the end.

use super::checker::Findings;
use super::fault::Fault;
use std::collections::BTreeMap;
use std::fmt;

/// Counts of faults, and findings.
#[derive(Debug)]
pub struct Report {
    /// The kinds of faults that had to happen.
    pub kinds: Vec<Fault>,
    /// How often each kind of fault has happened.
    pub faults: BTreeMap<Fault, usize>,
    /// What the checker found.
    pub findings: Findings,
    /// Length of a lease, seconds.
    pub lease_seconds: f64,
    /// Whatever else has failed, one line each.
    pub failures: Vec<String>,
}

impl Report {
    /// Kinds of faults that never happened: nothing was shown about them.
    pub fn missing(&self) -> Vec<&'static str> {
        let never = |fault: &Fault| self.faults.get(fault).copied().unwrap_or(0) == 0;
        let kinds = self.kinds.iter().filter(|it| never(it));
        kinds.map(|it| it.name()).collect()
    }

    /// Whether all faults happened and all promises were kept.
    pub fn passed(&self) -> bool {
        self.missing().is_empty() && self.findings.is_clean() && self.failures.is_empty()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = &self.findings;
        for fault in &self.kinds {
            let count = self.faults.get(fault).copied().unwrap_or(0);
            writeln!(f, "{:<28}{count:>8}", fault.name())?;
        }
        let rows = [
            ("jobs acknowledged", found.acknowledged),
            ("jobs lost", found.lost.len()),
            ("jobs duplicated", found.duplicated.len()),
            ("ends or tokens undone", found.unordered.len()),
            ("unwanted failures", found.failed.len()),
            ("late writes tried", found.stale_tried),
            ("late writes accepted", found.stale_accepted.len()),
            ("corrupt loads", found.corrupt_loads.len()),
            ("unreadable objects", found.unreadable.len()),
            ("orphaned objects", found.orphans),
            ("models that hoard", found.hoarded.len()),
            ("unfinished uploads", found.uploads.len()),
            ("recoveries", found.recoveries.len()),
        ];
        writeln!(f)?;
        for (name, count) in rows {
            writeln!(f, "{name:<28}{count:>8}")?;
        }
        for (name, share) in [("recovery p50, s", 0.5), ("recovery p99, s", 0.99)] {
            match found.recovery(share) {
                Some(seconds) => writeln!(f, "{name:<28}{seconds:>8.1}")?,
                None => writeln!(f, "{name:<28}{:>8}", "none")?,
            }
        }
        writeln!(f, "{:<28}{:>8.1}", "lease, s", self.lease_seconds)?;
        let missing = self.missing();
        if !missing.is_empty() {
            writeln!(f, "\nnever happened: {}", missing.join(", "))?;
        }
        let broken = found.broken().into_iter();
        for line in broken.chain(self.failures.iter().map(String::as_str)) {
            writeln!(f, "BROKEN: {line}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_that_never_happened_fails() {
        let mut report = Report {
            kinds: Fault::ALL.to_vec(),
            faults: Fault::ALL.into_iter().map(|fault| (fault, 1)).collect(),
            findings: Findings::default(),
            lease_seconds: 3.0,
            failures: Vec::new(),
        };
        assert!(report.passed());
        report.faults.insert(Fault::Poison, 0);
        assert!(!report.passed());
        assert_eq!(report.missing(), ["poison"]);
    }

    #[test]
    fn names_lead_back_to_kinds() {
        for fault in Fault::ALL {
            assert_eq!(Fault::of_name(fault.name()), Some(fault));
        }
    }
}
