//! Decision on whose poses a training refines.

use super::TrainError;
use super::people::Person;
use crate::config::Refine;
use yoto_capture::check::{PRECISE, jumps, precision};

/// Whether the poses of a person are refined, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Decision {
    pub refine: bool,
    /// For people; `None` where it was not for the training to decide.
    pub why: Option<String>,
}

/// The decision on `person`.
///
/// # Errors
/// Invalid skeleton.
pub(super) fn decide(who: Refine, person: &Person) -> Result<Decision, TrainError> {
    let asked = |refine| Ok(Decision { refine, why: None });
    match who {
        Refine::Never => return asked(false),
        Refine::Always => return asked(true),
        Refine::Auto => {}
    }
    let skeleton = |source| TrainError::Skeleton {
        name: person.name.clone(),
        source,
    };
    let wander = precision(&person.shard).map_err(skeleton)?;
    let jumps = jumps(&person.shard.track).map_err(skeleton)?.len();
    let wanders = wander.is_some_and(|metres| metres > PRECISE);
    let refine = wanders || jumps > 0;
    let found = match wander {
        _ if jumps > 0 && !wanders => format!("the body jumps {jumps} times as none can"),
        None => "too few frames show a whole body to tell how precise poses are".to_owned(),
        Some(metres) => {
            let than = if wanders { "more than" } else { "at most" };
            let (wander, limit) = (1e3 * metres, 1e3 * PRECISE);
            format!("bodies wander {wander:.1} mm off their masks, {than} {limit} mm")
        }
    };
    let then = match refine {
        true => "poses are refined",
        false => "poses stay as given",
    };
    let why = Some(format!("{}: {found}: {then}", person.name));
    Ok(Decision { refine, why })
}
