//! Identities: people are followed over all frames by the detector's numbers or, without them, by
//! position, and one of them is taken.

use super::detections::{Detection, Detections, SURE};
use crate::ImportError;
use crate::clip::fault;
use std::path::Path;

/// After this number of frames without a detection, a person counts as a new one.
const FORGOTTEN: usize = 15;
/// Largest motion of a person between two frames, as a multiple of the size of their box.
const FARTHEST: f64 = 0.5;
/// An error or a note names at most this number of people.
const NAMED: usize = 8;
/// A frame counts if it has at least this many confident points.
const FEWEST: usize = 6;

/// A person of a clip.
#[derive(Clone, Debug)]
pub(super) struct DetectedPerson<'a> {
    /// The detector's number, else the order of appearance.
    pub name: String,
    /// By index in [`Detections::frames`].
    pub seen: Vec<(usize, &'a Detection)>,
}

/// The person that the user names, else the one who is seen in most frames; with a note of the others.
///
/// # Errors
/// When nobody is found, or nobody has the name.
pub(super) fn choose<'a>(
    found: &'a Detections,
    name: Option<&str>,
    at: &Path,
    notes: &mut Vec<String>,
) -> Result<DetectedPerson<'a>, ImportError> {
    let mut people = gather(found);
    people.sort_by_key(|person| std::cmp::Reverse(person.seen.len()));
    let words = |person: &DetectedPerson| format!("{} ({} frames)", person.name, person.seen.len());
    let listed = |people: &[DetectedPerson]| {
        let mut text: Vec<String> = people.iter().take(NAMED).map(words).collect();
        if people.len() > NAMED {
            text.push(format!("{} more", people.len() - NAMED));
        }
        text.join(", ")
    };
    let joined = name.and_then(|name| found.other_ids.iter().find(|(other, _)| other == name));
    let name = joined.map_or(name, |(_, name)| Some(name));
    let index = match name {
        Some(name) => people.iter().position(|person| person.name == name),
        None => (!people.is_empty()).then_some(0),
    };
    let Some(index) = index else {
        let message = match name {
            Some(name) if !people.is_empty() => {
                format!("there is no person {name}; there are {}", listed(&people))
            }
            _ => format!("no frame shows a person with at least {FEWEST} confident key points"),
        };
        return Err(fault(at, "MISSING", message));
    };
    let taken = people.remove(index);
    if !people.is_empty() {
        notes.push(format!(
            "person {} is taken; there are also {} (--person)",
            words(&taken),
            listed(&people)
        ));
    }
    Ok(taken)
}

fn gather(found: &Detections) -> Vec<DetectedPerson<'_>> {
    let usable = |person: &&Detection| {
        person
            .picture
            .iter()
            .filter(|point| point[2] > SURE)
            .count()
            >= FEWEST
    };
    let mut people: Vec<DetectedPerson<'_>> = Vec::new();
    let all = || found.frames.iter().flat_map(|seen| &seen.people);
    let by_number = all().all(|person| person.person.is_some());
    for (at, seen) in found.frames.iter().enumerate() {
        let here: Vec<&Detection> = seen.people.iter().filter(usable).collect();
        if by_number {
            for detection in here {
                add_by_number(&mut people, at, detection);
            }
        } else {
            add_by_place(&mut people, found, at, &here);
        }
    }
    people
}

fn add_by_number<'a>(people: &mut Vec<DetectedPerson<'a>>, at: usize, detection: &'a Detection) {
    let Some(name) = &detection.person else {
        return;
    };
    match people.iter_mut().find(|person| person.name == *name) {
        Some(person) => {
            // If two people in a frame have the same number, the first counts.
            if person.seen.last().is_none_or(|(last, _)| *last != at) {
                person.seen.push((at, detection));
            }
        }
        None => people.push(DetectedPerson {
            name: name.clone(),
            seen: vec![(at, detection)],
        }),
    }
}

/// Pairs people with detections, the nearest first; those without a pair are new.
fn add_by_place<'a>(
    people: &mut Vec<DetectedPerson<'a>>,
    found: &Detections,
    at: usize,
    here: &[&'a Detection],
) {
    let number = |at: usize| found.frames.get(at).map_or(0, |seen| seen.number);
    let mut pairs = Vec::new();
    for (who, person) in people.iter().enumerate() {
        let Some((last, before)) = person.seen.last() else {
            continue;
        };
        let gap = number(at).saturating_sub(number(*last));
        if gap > FORGOTTEN {
            continue;
        }
        for (which, detection) in here.iter().enumerate() {
            let far = distance(before, detection);
            if far < FARTHEST * gap.max(1) as f64 {
                pairs.push((far, who, which));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut is_paired = vec![false; here.len()];
    let mut has_pair = vec![false; people.len()];
    for (_, who, which) in pairs {
        if let (Some(paired), Some(has)) = (is_paired.get_mut(which), has_pair.get_mut(who))
            && !*paired
            && !*has
            && let (Some(person), Some(detection)) = (people.get_mut(who), here.get(which))
        {
            (*paired, *has) = (true, true);
            person.seen.push((at, detection));
        }
    }
    for (detection, _) in here.iter().zip(is_paired).filter(|(_, paired)| !paired) {
        people.push(DetectedPerson {
            name: people.len().to_string(),
            seen: vec![(at, detection)],
        });
    }
}

/// The distance between the boxes of two detections: difference of middles and sizes over the larger one's side.
fn distance(a: &Detection, b: &Detection) -> f64 {
    let (Some(a), Some(b)) = (a.bounds(), b.bounds()) else {
        return f64::INFINITY;
    };
    let side = |[x0, y0, x1, y1]: [f64; 4]| (x1 - x0).max(y1 - y0);
    let size = side(a).max(side(b)).max(1.0);
    let ends = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    ends.fold(0.0, f64::max) / size
}
