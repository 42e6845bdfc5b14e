//! Poses with numbers that are not finite: a few are left out by frame and joint.

use crate::ImportError;
use crate::proof::{PoseEstimate, ToolOutput};
use crate::source::{Faulty, Part, not_finite};
use yoto_proto::smpl::JOINTS;

/// Leaves out the poses of `found`, read from the file of `root`, with numbers that are not finite; with a note.
///
/// # Errors
/// When many poses have such numbers.
pub(super) fn sieve(found: &mut ToolOutput, root: &Part<'_>) -> Result<(), ImportError> {
    let mut faulty = Faulty::default();
    let several = found.people.len() > 1;
    for person in &mut found.people {
        let name = &person.name;
        let mut kept = Vec::with_capacity(person.seen.len());
        for seen in std::mem::take(&mut person.seen) {
            let frame = root
                .clone()
                .of_frame(u32::try_from(seen.number).unwrap_or(u32::MAX));
            let read = match fault(&seen) {
                None => Ok(seen),
                Some(what) => {
                    let whose = if several {
                        format!("person {name}: ")
                    } else {
                        String::new()
                    };
                    Err(frame.fault("NOT_FINITE", format!("{whose}{what}")))
                }
            };
            kept.extend(faulty.keep(read)?);
        }
        person.seen = kept;
    }
    faulty.finish(&mut found.notes)
}

/// The first number of a pose that is not finite, in words.
fn fault(seen: &PoseEstimate) -> Option<String> {
    let mut others: Vec<(&str, &[f64])> =
        vec![("the translation", &seen.t), ("the shape", &seen.betas)];
    let named: Vec<String> = (seen.joints.iter())
        .filter_map(|(at, _)| Some(format!("the position of {}", JOINTS.get(*at)?.0)))
        .collect();
    let positions = seen.joints.iter().filter(|(at, _)| *at < JOINTS.len());
    for (name, (_, position)) in named.iter().zip(positions) {
        others.push((name, position));
    }
    if let Some(intrinsics) = &seen.intrinsics {
        others.push(("the focal length", &intrinsics.focal));
        if let Some(centre) = &intrinsics.centre {
            others.push(("the principal point", centre));
        }
    }
    not_finite(&seen.pose, &others)
}
