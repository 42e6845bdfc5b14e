//! The decision whether a training refines the poses of a person.

use crate::config::{Extent, Refine};
use crate::train::TrainError;
use crate::train::people::TrainPerson;
use yoto_capture::check::{PRECISE, jumps, precision};

/// Frames named of one fault.
const NAMED: usize = 8;

/// Whether the poses of a person are refined, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Decision {
    /// How far they are refined; `None` where they stay as given.
    pub refine: Option<Extent>,
    /// The reason, for people; `None` where it was not for the training to decide.
    pub why: Option<String>,
}

/// The decision on `person`. Where fits are `cheap`, poses that are hardly off are refined as well.
///
/// # Errors
/// Invalid skeleton.
pub(crate) fn decide(
    who: Refine,
    person: &TrainPerson,
    cheap: bool,
) -> Result<Decision, TrainError> {
    let asked = |refine| Ok(Decision { refine, why: None });
    match who {
        Refine::Never => return asked(None),
        Refine::Always => return asked(Some(Extent::Wide)),
        Refine::Auto => {}
    }
    let skeleton = |source| TrainError::Skeleton {
        name: person.name.clone(),
        source,
    };
    let wander = precision(&person.shard).map_err(skeleton)?;
    let jumps = jumps(&person.shard.track).map_err(skeleton)?;
    let wanders = wander.is_some_and(|metres| metres > PRECISE);
    // A lost frame jumps there and back; one jump alone is a cut in the film.
    let lost = jumps.len() > 1;
    let refine = match wanders || lost {
        true => Some(Extent::Wide),
        false => cheap.then_some(Extent::Fine),
    };
    let found = match wander {
        _ if lost && !wanders => {
            let shown: Vec<String> = jumps.iter().take(NAMED).map(u32::to_string).collect();
            let more = if jumps.len() > NAMED { ", …" } else { "" };
            let shown = shown.join(", ");
            format!("joints move farther than a body can before frames {shown}{more}")
        }
        None => "too few frames show a whole body to tell how precise poses are".to_owned(),
        Some(metres) => {
            let than = if wanders { "more than" } else { "at most" };
            let (wander, limit) = (1e3 * metres, 1e3 * PRECISE);
            format!("bodies wander {wander:.1} mm off their masks, {than} {limit} mm")
        }
    };
    let then = match refine {
        Some(Extent::Wide) => "poses are refined",
        Some(Extent::Fine) => "poses are refined finely",
        None => "poses stay as given",
    };
    let why = Some(format!("{}: {found}: {then}", person.name));
    Ok(Decision { refine, why })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use yoto_capture::ShardBuilder;
    use yoto_proto::pose_track::PoseTrack;
    use yoto_synthetic::{Estimator, SyntheticPerson};

    fn decision(
        who: Refine,
        frames: usize,
        cheap: bool,
        change: impl Fn(&mut PoseTrack),
    ) -> Decision {
        let (mut track, images) = SyntheticPerson::cast(1, 7)[0].capture(frames, 64);
        change(&mut track);
        let mut shard = ShardBuilder::new(track);
        for image in &images {
            shard.push(image).expect("a frame");
        }
        let person = TrainPerson {
            slot: 0,
            name: "ada".into(),
            shard: Arc::new(shard.finish().expect("a shard")),
        };
        decide(who, &person, cheap).expect("a skeleton")
    }

    #[test]
    fn poses_are_refined_where_they_are_imprecise() {
        let exact = decision(Refine::Auto, 32, false, |_| {});
        assert_eq!(exact.refine, None);
        assert!(exact.why.expect("a reason").contains("stay as given"));
        let exact = decision(Refine::Auto, 32, true, |_| {});
        assert_eq!(exact.refine, Some(Extent::Fine));
        assert!(exact.why.expect("a reason").contains("finely"));
        let estimated = decision(Refine::Auto, 32, false, |track| {
            let estimator = Estimator {
                mistakes: 0.0,
                ..Estimator::default()
            };
            *track = estimator.estimate(track, 1).expect("an estimate").track;
        });
        assert_eq!(estimated.refine, Some(Extent::Wide));
        let lost = decision(Refine::Auto, 32, false, |track| {
            track.frames[9].translation[2] -= 1.5;
        });
        assert_eq!(lost.refine, Some(Extent::Wide));
        let why = lost.why.expect("a reason");
        assert!(
            why.contains("before frames 9, 10") || why.contains("wander"),
            "{why}"
        );
        let short = decision(Refine::Auto, 4, false, |track| {
            let still = track.frames[0].clone();
            for frame in &mut track.frames {
                frame.pose.clone_from(&still.pose);
                frame.translation = still.translation;
            }
        });
        assert!(short.refine.is_none() && short.why.expect("a reason").contains("too few"));
    }

    #[test]
    fn what_is_asked_for_needs_no_reason() {
        for (who, refine) in [(Refine::Always, Some(Extent::Wide)), (Refine::Never, None)] {
            assert_eq!(
                decision(who, 4, true, |_| {}),
                Decision { refine, why: None }
            );
        }
    }
}
