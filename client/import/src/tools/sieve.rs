//! Poses with numbers that are not finite: a few are left out by frame and joint.

use crate::geometry::Vec3;
use crate::proof::{Found, PoseEstimate};
use crate::source::{Faulty, Part, is_number};
use yoto_client::ClientError;
use yoto_proto::smpl::JOINTS;

/// Leaves poses out of what was `found` in the file of `root` that have numbers which are not finite, with a note.
///
/// # Errors
/// When many have.
pub(super) fn sieve(found: &mut Found, root: &Part<'_>) -> Result<(), ClientError> {
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
                Some((what, value)) => {
                    let whose = if several {
                        format!("person {name}: ")
                    } else {
                        String::new()
                    };
                    Err(frame.fault("NOT_FINITE", format!("{whose}{what} is {value}")))
                }
            };
            kept.extend(faulty.keep(read)?);
        }
        person.seen = kept;
    }
    faulty.finish(&mut found.notes)
}

/// What is not finite of a pose, and its value.
fn fault(seen: &PoseEstimate) -> Option<(String, f64)> {
    let bad = |values: &[f64]| values.iter().copied().find(|value| !is_number(*value));
    let joint = |(at, rotation): (usize, &Vec3)| {
        let (name, _) = JOINTS.get(at)?;
        Some((format!("the rotation of {name}"), bad(rotation)?))
    };
    let posed = |(at, position): &(usize, Vec3)| {
        let (name, _) = JOINTS.get(*at)?;
        Some((format!("the position of {name}"), bad(position)?))
    };
    let named = |name: &str, values: &[f64]| Some((name.to_owned(), bad(values)?));
    let rotations = seen.pose.as_chunks::<3>().0;
    let intrinsics = seen.intrinsics.as_ref();
    (rotations.iter().enumerate().find_map(joint))
        .or_else(|| named("the translation", &seen.t))
        .or_else(|| named("the shape", &seen.betas))
        .or_else(|| seen.joints.iter().find_map(posed))
        .or_else(|| named("the focal length", &intrinsics?.focal))
        .or_else(|| named("the principal point", &intrinsics?.centre?))
}
