//! Chooses the person in a clip to follow.

use super::parts::PartModels;
use super::sheet;
use super::watch::{self, Watched};
use crate::clip::{Clip, fault, for_each};
use crate::{ImportError, Options};
use image::RgbImage;
use yoto_landmarks::{BodySquare, PersonTrack, Sighting, Target, Watcher, people};
use yoto_proto::text::count;

/// A note and the sheet name at most this number of people.
const NAMED: usize = 6;
/// A person is named if seen in at least this number of frames: others may be errors of the pose model.
const FEWEST: usize = 2;
/// Two pictures show different scenes if their mean difference is at least this, levels.
const OTHER_SCENE: f32 = 30.0;

/// The frames that show the followed person.
pub(super) struct Followed {
    pub watched: Vec<Watched>,
    /// A note about the followed person and the others; `None` for one person alone.
    pub note: Option<String>,
    /// Everybody with their numbers.
    pub sheet: Option<RgbImage>,
    /// Whether frames that show another person are left out.
    pub is_one_of_several: bool,
}

/// Looks for a person in the frames `wanted`. If several people were found one after the other, one of them is looked for again: the
/// one that the options name, else the largest who is seen longest.
///
/// # Errors
/// When nobody has the number that the options name; when a frame can't be read.
pub(super) fn follow(
    watcher: &mut Watcher,
    parts: &mut PartModels,
    clip: &Clip,
    wanted: &[usize],
    options: &Options,
) -> Result<Followed, ImportError> {
    let watched = watch::watch(watcher, parts, clip, wanted, &options.progress)?;
    let found = people(&sightings(&watched));
    let named: Vec<&PersonTrack> = found
        .iter()
        .enumerate()
        .filter(|(at, person)| *at == 0 || person.seen.len() >= FEWEST)
        .map(|(_, person)| person)
        .collect();
    let index = match &options.person {
        None => 0,
        Some(name) => number(name, named.len()).ok_or_else(|| {
            let message = match named.is_empty() {
                true => "nobody was found".to_owned(),
                false => format!(
                    "there is no person {name}; there are {}",
                    listed(&named, clip)
                ),
            };
            fault(clip.path(), "MISSING", message)
        })?,
    };
    let Some(person) = named.get(index).filter(|_| found.len() > 1) else {
        return Ok(Followed {
            watched,
            note: None,
            sheet: None,
            is_one_of_several: false,
        });
    };
    let steps = wanted.windows(2).map(|pair| pair[1] - pair[0]);
    let is_same = |it: &&PersonTrack| std::ptr::eq(*it, *person);
    let at = found.iter().position(|it| is_same(&it)).unwrap_or(0);
    let target = Target::new(&found, at, steps.max().unwrap_or(1));
    let watched = match target {
        Some(target) => {
            watcher.follow(Some(target));
            watch::watch(watcher, parts, clip, wanted, &options.progress)?
        }
        None => {
            let is_seen = |it: &Watched| person.seen.iter().any(|(at, _)| *at == it.index);
            watched.into_iter().filter(is_seen).collect()
        }
    };
    let are_several = named.len() > 1;
    Ok(Followed {
        watched,
        note: are_several.then(|| {
            format!(
                "several people are in the clip: person {} is followed; there are {} (--person)",
                index + 1,
                listed(&named, clip)
            )
        }),
        sheet: match are_several {
            true => Some(numbered(&named, clip)?),
            false => None,
        },
        is_one_of_several: true,
    })
}

fn sightings(watched: &[Watched]) -> Vec<Sighting> {
    let mut sightings = Vec::with_capacity(watched.len());
    let mut before: Option<&Watched> = None;
    for it in watched {
        if let Some(figure) = it.figure {
            sightings.push(Sighting {
                at: it.index,
                figure,
                is_cut: before.is_some_and(|before| it.scene.differs(&before.scene) > OTHER_SCENE),
            });
            before = Some(it);
        }
    }
    sightings
}

/// The index of the person with the number `name`, from 1 to `count`.
fn number(name: &str, count: usize) -> Option<usize> {
    let number: usize = name.parse().ok()?;
    (1..=count).contains(&number).then(|| number - 1)
}

/// `1 (41 frames from 0 to 40, 320 px, left), 2 (20 frames from 41 to 60, 300 px, right)`.
fn listed(people: &[&PersonTrack], clip: &Clip) -> String {
    let all = people.iter().take(NAMED).enumerate();
    let all = all.map(|(at, person)| format!("{} ({})", at + 1, words(person, clip)));
    all.collect::<Vec<_>>().join(", ")
}

fn words(person: &PersonTrack, clip: &Clip) -> String {
    let mut sides: Vec<f32> = person.seen.iter().map(|(_, it)| it.side).collect();
    let mut places: Vec<f32> = person.seen.iter().map(|(_, it)| it.hips[0]).collect();
    sides.sort_by(f32::total_cmp);
    places.sort_by(f32::total_cmp);
    let median = |of: &[f32]| of.get(of.len() / 2).copied().unwrap_or(0.0);
    let place = match median(&places) / clip.size[0] as f32 {
        share if share < 1.0 / 3.0 => "left",
        share if share > 2.0 / 3.0 => "right",
        _ => "in the middle",
    };
    let ends = [person.seen.first(), person.seen.last()];
    let [first, last] = ends.map(|it| it.map_or(0, |(at, _)| *at));
    format!(
        "{} from {first} to {last}, {:.0} px, {place}",
        count(person.seen.len(), "frame"),
        median(&sides) / BodySquare::MARGIN
    )
}

/// A picture of everybody with their numbers, each in the middle one of their frames.
fn numbered(people: &[&PersonTrack], clip: &Clip) -> Result<RgbImage, ImportError> {
    let middle = |person: &PersonTrack| person.seen.get(person.seen.len() / 2).copied();
    let mut places: Vec<(usize, BodySquare, usize)> = people
        .iter()
        .take(NAMED)
        .enumerate()
        .filter_map(|(at, person)| middle(person).map(|(frame, figure)| (frame, figure, at + 1)))
        .collect();
    places.sort_by_key(|(frame, ..)| *frame);
    let frames: Vec<usize> = places.iter().map(|(frame, ..)| *frame).collect();
    let mut tiles = Vec::new();
    for_each(clip, &frames, |frame, rgb| {
        let here = places.iter().find(|(at, ..)| *at == frame);
        if let Some((_, figure, number)) = here {
            tiles.push((*number, sheet::tile(rgb, clip.size, figure, *number)));
        }
        Ok(())
    })?;
    tiles.sort_by_key(|(number, _)| *number);
    Ok(sheet::beside(tiles.into_iter().map(|(_, tile)| tile)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_are_named_by_numbers_from_1() {
        assert_eq!(number("1", 2), Some(0));
        assert_eq!(number("2", 2), Some(1));
        for other in ["0", "3", "ada", ""] {
            assert_eq!(number(other, 2), None, "{other}");
        }
    }
}
