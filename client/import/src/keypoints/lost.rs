//! Joins people that a detector lost and found again under another number, if time, place, size and colours agree.

use super::detections::{Detection, Detections};
use crate::ImportError;
use crate::clip::{Clip, for_each};
use crate::identities::{PersonTrack, follows, joined};
use std::collections::BTreeSet;
use yoto_landmarks::colours::{OTHER_COLOURS, difference, opponent};
use yoto_pose::{FrameKeyPoints, KeyPointSet, patches};

/// Largest motion per frame and at once, as a share of the person's box.
const MOTION: [f64; 2] = [0.3, 0.1];

/// A person in one frame of the detector's.
#[derive(Clone)]
struct Sight {
    number: usize,
    /// The clip's frame, if it has one.
    frame: Option<usize>,
    detection: Detection,
    /// Colours of chest and belly; empty where they are not looked at or not seen.
    colours: Vec<[f32; 3]>,
}

/// A person by the detector's number.
struct Numbered {
    name: String,
    /// All numbers of the person.
    names: Vec<String>,
    first: Sight,
    last: Sight,
    frames: usize,
}

impl PersonTrack for Numbered {
    fn name(&self) -> &str {
        &self.name
    }

    fn ends(&self) -> Option<[usize; 2]> {
        Some([self.first.number, self.last.number])
    }

    fn distance(&self, next: &Self, gap: usize) -> f64 {
        let ends = [&self.last, &next.first].map(|it| it.detection.bounds());
        let [Some(a), Some(b)] = ends else {
            return f64::INFINITY;
        };
        let side = |[x0, y0, x1, y1]: [f64; 4]| (x1 - x0).max(y1 - y0);
        let size = side(a).max(side(b)).max(1.0);
        let ends = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        ends.fold(0.0, f64::max) / size / (MOTION[0] + MOTION[1] * gap as f64)
    }

    fn looks(&self, next: &Self) -> Option<f64> {
        let pairs = self.last.colours.iter().zip(&next.first.colours);
        let off: Vec<f32> = pairs.map(|(a, b)| difference(a, b)).collect();
        let mean = off.iter().sum::<f32>() / off.len() as f32;
        (!off.is_empty()).then(|| f64::from(mean / OTHER_COLOURS))
    }

    fn append(&mut self, next: Self) {
        self.names.extend(next.names);
        self.last = next.last;
        self.frames += next.frames;
    }

    fn frames(&self) -> usize {
        self.frames
    }
}

/// Gives one number to a person that the detector lost and found again, with notes.
///
/// # Errors
/// A frame of the clip that can't be decoded.
pub(super) fn join(
    found: &mut Detections,
    clip: &Clip,
    notes: &mut Vec<String>,
) -> Result<(), ImportError> {
    let Some(mut people) = numbered(found, clip) else {
        return Ok(());
    };
    look(&mut people, found.set, clip)?;
    for person in joined(people, notes).iter().filter(|it| it.names.len() > 1) {
        let others = person.names.iter().filter(|it| **it != person.name);
        let ids = others.map(|other| (other.clone(), person.name.clone()));
        found.other_ids.extend(ids);
        let all = found.frames.iter_mut().flat_map(|seen| &mut seen.people);
        for detection in all {
            if detection
                .person
                .as_ref()
                .is_some_and(|name| person.names.contains(name))
            {
                detection.person = Some(person.name.clone());
            }
        }
    }
    Ok(())
}

/// The people by the detector's numbers; `None` without numbers.
fn numbered(found: &Detections, clip: &Clip) -> Option<Vec<Numbered>> {
    let first = found.counting(clip).map(|counting| counting.first);
    let mut people: Vec<Numbered> = Vec::new();
    for seen in &found.frames {
        let frame = match first {
            Some(first) => seen.number.checked_sub(first),
            None => seen.image.as_deref().and_then(|name| clip.named(name)),
        };
        for detection in &seen.people {
            let name = detection.person.as_ref()?;
            let here = Sight {
                number: seen.number,
                frame: frame.filter(|frame| *frame < clip.frames),
                detection: detection.clone(),
                colours: Vec::new(),
            };
            match people.iter_mut().find(|person| person.name == *name) {
                Some(person) => {
                    person.last = here;
                    person.frames += 1;
                }
                None => people.push(Numbered {
                    name: name.clone(),
                    names: vec![name.clone()],
                    first: here.clone(),
                    last: here,
                    frames: 1,
                }),
            }
        }
    }
    Some(people)
}

/// Reads the colours of people where one may continue under another number.
fn look(people: &mut [Numbered], set: KeyPointSet, clip: &Clip) -> Result<(), ImportError> {
    let mut wanted = BTreeSet::new();
    for one in people.iter() {
        for next in people.iter().filter(|next| follows(one, *next).is_some()) {
            wanted.extend(one.last.frame);
            wanted.extend(next.first.frame);
        }
    }
    let wanted: Vec<usize> = wanted.into_iter().collect();
    let size = clip.size.map(|side| side as usize);
    for_each(clip, &wanted, |frame, rgb| {
        let ends = people
            .iter_mut()
            .flat_map(|person| [&mut person.first, &mut person.last]);
        for sight in ends.filter(|sight| sight.frame == Some(frame)) {
            let points = FrameKeyPoints {
                picture: sight.detection.picture.clone(),
                ..FrameKeyPoints::default()
            };
            // Hair and face change as the head turns.
            let clothes = patches(set, &points, rgb, size).into_iter().skip(1);
            sight.colours = clothes
                .map(|colour| opponent(colour.map(|share| 255.0 * share as f32)))
                .collect();
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::super::detections::FrameDetections;
    use super::*;
    use image::{Rgb, RgbImage};

    const RED: [u8; 3] = [170, 60, 50];
    const BLUE: [u8; 3] = [50, 80, 150];

    /// Points of somebody who stands with the left edge of the box at `x`, 40 by 100 pixels.
    fn standing(name: &str, x: f64) -> Detection {
        let at = |across: f64, down: f64| [x + across, 10.0 + down, 0.9];
        let mut picture = vec![at(20.0, 0.0); 5];
        for (left, right, down) in [(30.0, 10.0, 20.0), (38.0, 2.0, 35.0), (40.0, 0.0, 50.0)] {
            picture.extend([at(left, down), at(right, down)]);
        }
        for down in [55.0, 75.0, 100.0] {
            picture.extend([at(28.0, down), at(12.0, down)]);
        }
        Detection {
            hands: [None, None],
            face: None,
            person: Some(name.into()),
            picture,
            space: Vec::new(),
            mask: None,
            own: None,
        }
    }

    /// Person 0 in frames 0 to 19 and person 3 in frames 22 to 41 at one place, in clothes of two colours, beside person 7: the
    /// names of all, and the notes.
    fn join_in(colours: [[u8; 3]; 2]) -> (BTreeSet<String>, Vec<String>) {
        let folder = tempfile::tempdir().expect("a folder");
        for frame in 0..42 {
            let clothes = Rgb(colours[usize::from(frame >= 20)]);
            let mut picture = RgbImage::from_pixel(160, 120, Rgb([90, 90, 90]));
            for (x, y) in (20..60).flat_map(|x| (10..110).map(move |y| (x, y))) {
                picture.put_pixel(x, y, clothes);
            }
            let path = folder.path().join(format!("{frame:03}.png"));
            picture.save(path).expect("writes");
        }
        let clip = Clip::open(folder.path(), &crate::Options::default()).expect("a clip");
        let frame = |number: usize| FrameDetections {
            number,
            image: None,
            people: vec![
                standing(if number < 20 { "0" } else { "3" }, 20.0),
                standing("7", 110.0),
            ],
        };
        let frames = (0..20).chain(22..42).map(frame).collect();
        let mut found = Detections::new("a detector", KeyPointSet::Coco17, frames);
        let mut notes = Vec::new();
        join(&mut found, &clip, &mut notes).expect("reads");
        let people = found.frames.iter().flat_map(|seen| &seen.people);
        (people.filter_map(|it| it.person.clone()).collect(), notes)
    }

    #[test]
    fn a_person_with_two_numbers_is_one() {
        let (names, notes) = join_in([RED, RED]);
        assert_eq!(names, BTreeSet::from(["0".into(), "7".into()]));
        let [note] = &notes[..] else {
            panic!("{notes:?}");
        };
        assert!(
            note.starts_with(
                "person 0 goes on as 3 (3 frames later, at the same place, in the same colours)"
            ),
            "{note}"
        );
    }

    #[test]
    fn somebody_in_other_clothes_at_the_same_place_is_another() {
        let (names, notes) = join_in([RED, BLUE]);
        assert_eq!(names.len(), 3, "{names:?}");
        let [note] = &notes[..] else {
            panic!("{notes:?}");
        };
        assert!(
            note.starts_with("person 3 begins where person 0 ends, in other colours"),
            "{note}"
        );
    }
}
