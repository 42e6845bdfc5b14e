//! Frames of a file that can't be used: a few are left out and named, many are a fault of the file.

use crate::ImportError;
use yoto_proto::pose_track::describe;

/// Largest share of frames that are left out.
pub(crate) const FEW: f64 = 0.25;
/// Largest plausible number in any unit.
const MAX_NUMBER: f64 = 1e9;
/// A note names at most this number of frames.
const NAMED: usize = 4;

/// Whether `value` is finite and plausible in some unit.
pub(crate) fn is_number(value: f64) -> bool {
    value.is_finite() && value.abs() <= MAX_NUMBER
}

/// The number of frames that were read, and the faults of some.
#[derive(Debug, Default)]
pub(crate) struct Faulty {
    tried: usize,
    bad: Vec<String>,
    first: Option<ImportError>,
}

impl Faulty {
    /// The value of `read`; `None` for a fault of the frame, which is kept.
    ///
    /// # Errors
    /// Errors that are not faults of the frame, such as a file that can't be opened.
    pub(crate) fn keep<T>(
        &mut self,
        read: Result<T, ImportError>,
    ) -> Result<Option<T>, ImportError> {
        self.tried += 1;
        match read {
            Ok(value) => Ok(Some(value)),
            Err(ImportError::BadCapture { place, violations }) => {
                self.bad.extend(violations.first().map(describe));
                self.first
                    .get_or_insert(ImportError::BadCapture { place, violations });
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// A note about the frames that are left out.
    ///
    /// # Errors
    /// The first fault, if many frames have one.
    pub(crate) fn finish(self, notes: &mut Vec<String>) -> Result<(), ImportError> {
        let count = self.bad.len();
        if count as f64 > FEW * self.tried as f64 {
            return self
                .first
                .map_or(Ok(()), |first| Err(with_count(first, count, self.tried)));
        }
        if count > 0 {
            let named = self.bad.iter().take(NAMED).cloned().collect::<Vec<_>>();
            let more = if count > NAMED { "; …" } else { "" };
            notes.push(format!(
                "left out: {count} of {} poses, which can't be used: {}{more}",
                self.tried,
                named.join("; ")
            ));
        }
        Ok(())
    }
}

/// `first`, a fault of one of `tried` frames, with the number of frames that have one.
fn with_count(mut first: ImportError, count: usize, tried: usize) -> ImportError {
    if let ImportError::BadCapture { violations, .. } = &mut first
        && let Some(violation) = violations.first_mut()
        && tried > 1
    {
        violation.message += &format!(" ({count} of {tried} frames can't be used)");
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::pose_track::violation;

    fn of(bad: usize, all: usize) -> Result<Vec<String>, ImportError> {
        let mut faulty = Faulty::default();
        for at in 0..all {
            let fault = ImportError::BadCapture {
                place: "here".into(),
                violations: vec![violation("X", "a.pkl", Some(at as u32), "pose", "NaN")],
            };
            let kept = faulty.keep(if at < bad { Err(fault) } else { Ok(at) });
            assert_eq!(kept.expect("a fault of the frame").is_some(), at >= bad);
        }
        let mut notes = Vec::new();
        faulty.finish(&mut notes).map(|()| notes)
    }

    #[test]
    fn a_few_bad_frames_are_named_and_many_refused() {
        assert_eq!(of(0, 8).expect("all good"), Vec::<String>::new());
        let notes = of(2, 8).expect("a few").join("\n");
        assert!(
            notes.contains("2 of 8 poses") && notes.contains("a.pkl"),
            "{notes}"
        );
        let error = of(3, 8).expect_err("many").to_string();
        assert!(
            error.contains("pose: NaN (3 of 8 frames can't be used)"),
            "{error}"
        );
        let alone = of(1, 1).expect_err("the only one").to_string();
        assert!(alone.ends_with("pose: NaN"), "{alone}");
        let missing = ImportError::Unusable("no such file".into());
        assert!(Faulty::default().keep::<()>(Err(missing)).is_err());
    }
}
