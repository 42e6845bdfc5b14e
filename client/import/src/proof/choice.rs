//! The person to take, the masks that show them, and the reading that agrees with these.

use super::found::{ToolOutput, TrackedPerson};
use super::masks::Masks;
use super::numbers::Numbers;
use super::reading::{Documented, Reading};
use super::rest::Rest;
use super::score::{Proof, Proven};
use super::silhouette::LEAST;
use crate::clip::{Clip, fault};
use crate::{ImportError, Options};
use std::path::Path;

/// Most people that are compared with masks, those seen most often first.
const MOST_PEOPLE: usize = 6;
/// A reading with at least this figure agrees well.
pub(crate) const GOOD: f64 = 0.7;
/// Two people are both in the same masks if the worse figure is at least this share of the better one: a tracker may give
/// one person several numbers.
const ALIKE: f64 = 0.8;
/// An error names at most this number of readings.
const NAMED: usize = 5;
/// Sizes of an average adult that are tried, from the first to the last.
const SIZES: (f64, f64, usize) = (0.8, 1.2, 21);

/// The chosen person, with rest joints, masks and reading.
pub(crate) struct ImportChoice<'a> {
    pub person: &'a TrackedPerson,
    pub rest: Rest,
    /// `None` where there are no masks.
    pub masks: Option<&'a Masks>,
    pub reading: Reading,
}

/// A person with the masks and the reading that agree best.
struct Candidate<'a> {
    choice: ImportChoice<'a>,
    proven: Option<(Proven, Vec<Proven>)>,
    /// Pixels of the masks of all frames with the person.
    masked: f64,
    notes: Vec<String>,
}

impl Candidate<'_> {
    fn figure(&self) -> f64 {
        self.proven.as_ref().map_or(0.0, |(best, _)| best.figure)
    }

    fn has_masks_of(&self, other: &Self) -> bool {
        match (self.choice.masks, other.choice.masks) {
            (Some(one), Some(other)) => std::ptr::eq(one, other),
            _ => false,
        }
    }
}

/// The candidate with most masked pixels, of those that their masks show. Masks show the people who agree
/// with them about as well as the best one, so that a person beside or behind them is not taken, even if
/// seen for longer. Without such people, the candidate that agrees best.
fn most_masked(candidates: Vec<Candidate<'_>>) -> Option<Candidate<'_>> {
    let is_shown = |one: &Candidate<'_>| {
        let rivals = candidates.iter().filter(|other| one.has_masks_of(other));
        let best = rivals.map(Candidate::figure).fold(0.0, f64::max);
        one.figure() >= LEAST && one.figure() >= ALIKE * best
    };
    let shown: Vec<bool> = candidates.iter().map(is_shown).collect();
    let worth = |(is_shown, one): &(bool, Candidate<'_>)| match is_shown {
        true => (1, one.masked),
        false => (0, one.figure()),
    };
    let all = shown.into_iter().zip(candidates);
    // Of equals the first, who is seen most often.
    let best = all.reduce(|best, one| {
        let ((above, much), (best_above, best_much)) = (worth(&one), worth(&best));
        if (above, much) > (best_above, best_much) {
            one
        } else {
            best
        }
    });
    best.map(|(_, candidate)| candidate)
}

impl<'a> ImportChoice<'a> {
    /// The choice for the tool's `found` among `masks`; `at` is the tool's file, for errors.
    ///
    /// # Errors
    /// When the user's person is not there; when no reading agrees with the masks.
    #[expect(
        clippy::too_many_arguments,
        reason = "everything that is known of the clip decides"
    )]
    pub(crate) fn find(
        tool: &Documented,
        found: &'a ToolOutput,
        masks: &'a [Masks],
        numbers: Numbers,
        clip: &'a Clip,
        at: &Path,
        options: &Options,
        notes: &mut Vec<String>,
    ) -> Result<Self, ImportError> {
        let people = people(found, masks, at, options)?.into_iter();
        let candidates =
            people.map(|person| candidate(tool, person, masks, numbers, clip, at, options));
        let best = most_masked(candidates.collect::<Result<_, _>>()?);
        let Some(best) = best else {
            return Err(fault(at, "EMPTY", "there is nobody in these files"));
        };
        let others: Vec<String> = found
            .people
            .iter()
            .filter(|person| person.name != best.choice.person.name)
            .map(|person| format!("{} ({} frames)", person.name, person.seen.len()))
            .collect();
        if !others.is_empty() {
            notes.push(format!(
                "person {} is taken ({} frames); there are also {} (--person)",
                best.choice.person.name,
                best.choice.person.seen.len(),
                others.join(", ")
            ));
        }
        notes.extend(best.notes);
        let documented = Reading::documented(tool, best.choice.person.seen.first(), options.focal);
        match &best.proven {
            None if masks.is_empty() => notes.push(format!(
                "no masks, neither in the tool's files nor by --masks: the capture has none, and nothing \
                 proves that the numbers are as {} documents ({})",
                tool.tool,
                documented.words()
            )),
            None => {
                let message = "no frame has both a pose and a mask: are the masks of this clip?";
                return Err(fault(at, "MISSING", message));
            }
            Some((taken, tried)) => {
                notes.push(said(tool, &best.choice, taken, tried, &documented, at)?);
            }
        }
        Ok(best.choice)
    }
}

/// The people to choose from: the user's; else the one with most masked pixels; else all people that a
/// folder of masks may show, else the one seen most often.
fn people<'a>(
    found: &'a ToolOutput,
    masks: &[Masks],
    at: &Path,
    options: &Options,
) -> Result<Vec<&'a TrackedPerson>, ImportError> {
    if let Some(name) = &options.person {
        let joined = found.other_ids.iter().find(|(other, _)| other == name);
        let name = joined.map_or(name, |(_, name)| name);
        let person = found.people.iter().find(|person| person.name == *name);
        return person.map(|person| vec![person]).ok_or_else(|| {
            let names = found.people.iter().map(|person| &*person.name);
            let others = found.other_ids.iter().map(|(other, _)| &**other);
            let names: Vec<&str> = names.chain(others).collect();
            let message = format!("there is no person {name}; there are {}", names.join(", "));
            fault(at, "MISSING", message)
        });
    }
    let mut people: Vec<&TrackedPerson> = found
        .people
        .iter()
        .filter(|person| !person.seen.is_empty())
        .collect();
    let pixels = |person: &TrackedPerson| -> usize {
        let masks = person.seen.iter().filter_map(|seen| seen.mask.as_ref());
        masks.map(|mask| mask.area()).sum()
    };
    people.sort_by_key(|person| std::cmp::Reverse((pixels(person), person.seen.len())));
    let are_chosen_by_masks = masks.iter().any(|masks| !masks.are_of_poses());
    people.truncate(if are_chosen_by_masks { MOST_PEOPLE } else { 1 });
    Ok(people)
}

fn candidate<'a>(
    tool: &Documented,
    person: &'a TrackedPerson,
    all: &'a [Masks],
    numbers: Numbers,
    clip: &'a Clip,
    at: &Path,
    options: &Options,
) -> Result<Candidate<'a>, ImportError> {
    let first = person.seen.first();
    let documented = Reading::documented(tool, first, options.focal);
    if let Some(seen) = first {
        let camera = documented.camera(seen, clip.size);
        camera.map_err(|message| fault(at, "SIZE_MISMATCH", message))?;
    }
    let mut best: Option<Candidate<'a>> = None;
    for masks in all {
        let mut notes = Vec::new();
        let mut rest = Rest::find(options, tool, person, at, &mut notes)?;
        let mut proof = Proof::new(person, masks, numbers, clip);
        if !rest.is_measured {
            let height = fit_size(&mut proof, &documented, &mut rest)?;
            notes.push(format!("{height:.2} m tall agrees best with the masks"));
        }
        let has_own = first.is_some_and(|seen| seen.intrinsics.is_some());
        let readings = documented.others(has_own, !masks.are_of_poses());
        let proven = proof.best(&readings, &rest)?;
        let reading = proven.as_ref().map_or(documented, |(best, _)| best.reading);
        let found = Candidate {
            choice: ImportChoice {
                person,
                rest,
                masks: Some(masks),
                reading,
            },
            proven,
            masked: proof.masked(),
            notes,
        };
        if best
            .as_ref()
            .is_none_or(|best| found.figure() > best.figure())
        {
            best = Some(found);
        }
    }
    if let Some(best) = best {
        return Ok(best);
    }
    let mut notes = Vec::new();
    let rest = Rest::find(options, tool, person, at, &mut notes)?;
    Ok(Candidate {
        choice: ImportChoice {
            person,
            rest,
            masks: None,
            reading: documented,
        },
        proven: None,
        masked: 0.0,
        notes,
    })
}

/// Makes an average skeleton as large as agrees best with the masks; the height, metres.
fn fit_size(proof: &mut Proof<'_>, reading: &Reading, rest: &mut Rest) -> Result<f64, ImportError> {
    let (from, to, steps) = SIZES;
    let mut best = (f64::MIN, 1.0);
    for step in 0..steps {
        let size = from + (to - from) * step as f64 / (steps - 1) as f64;
        rest.scale(size);
        let figure = proof.figure(reading, rest)?.unwrap_or_default();
        rest.scale(1.0 / size);
        if figure > best.0 {
            best = (figure, size);
        }
    }
    rest.scale(best.1);
    Ok(yoto_capture::skeleton::smpl::ASSUMED_HEIGHT * best.1)
}

/// A note about the reading that was taken.
///
/// # Errors
/// When even that does not agree with the masks.
fn said(
    tool: &Documented,
    choice: &ImportChoice<'_>,
    taken: &Proven,
    tried: &[Proven],
    documented: &Reading,
    at: &Path,
) -> Result<String, ImportError> {
    let percent = |figure: f64| format!("{:.0} %", 100.0 * figure);
    let masks = choice.masks.map_or("masks", |masks| &masks.words);
    if taken.figure < LEAST {
        let named: Vec<String> = tried
            .iter()
            .take(NAMED)
            .map(|it| format!("{}: {}", it.reading.words(), percent(it.figure)))
            .collect();
        let message = format!(
            "the poses do not agree with {masks} in any of {} readings: at best {}, {} are needed; tried {}. \
             Are poses and masks of this clip and of the same person?",
            tried.len(),
            percent(taken.figure),
            percent(LEAST),
            named.join("; ")
        );
        return Err(fault(at, "UNPROVEN", message));
    }
    let usual = tried.iter().find(|it| it.reading == *documented);
    let mut note = if taken.reading == *documented {
        format!(
            "read as {} documents ({}); the body agrees with {masks} to {}",
            tool.tool,
            taken.reading.words(),
            percent(taken.figure)
        )
    } else {
        format!(
            "not as {} documents: {} agrees with {masks} to {}, the documented reading ({}) only to {}",
            tool.tool,
            taken.reading.words(),
            percent(taken.figure),
            documented.words(),
            percent(usual.map_or(0.0, |it| it.figure))
        )
    };
    if taken.figure < GOOD {
        note += &format!(
            ". That is poor, {} and more are usual: are these masks and poses of the same frames?",
            percent(GOOD)
        );
    }
    Ok(note)
}
