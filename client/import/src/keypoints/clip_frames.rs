//! Fits detections to the clip before anybody is chosen: numbers that are times, frames beyond its end, and people who got two numbers.

use super::detections::{Detection, Detections, FrameDetections};
use crate::clip::{Clip, beyond, too_far};
use crate::identities::{Track, joined};

/// Changes `found` so that it is of the clip; notes say what was assumed.
pub(super) fn fit(found: &mut Detections, clip: &Clip) -> Vec<String> {
    let mut notes = Vec::new();
    let is_named = |seen: &FrameDetections| {
        seen.image
            .as_ref()
            .is_some_and(|name| clip.named(name).is_some())
    };
    if !found.frames.iter().all(is_named) {
        notes.extend(times(&mut found.frames, clip.frames));
        notes.extend(end(&mut found.frames, clip.frames));
    }
    join(&mut found.frames, &mut notes);
    notes
}

/// Numbers far beyond the clip, as times of pictures in their names are, become places in their order if there are as many as frames,
/// or as time in steps of equal length.
fn times(frames: &mut [FrameDetections], count: usize) -> Option<String> {
    let (first, last) = (frames.first()?.number, frames.last()?.number);
    if last < too_far(count) {
        return None;
    }
    let mut steps: Vec<usize> = frames
        .windows(2)
        .map(|pair| pair[1].number - pair[0].number)
        .collect();
    steps.sort_unstable();
    let median = *steps.get(steps.len() / 2)?;
    // Steps of one frame; others are gaps. Their mean has the fraction that a whole step lacks.
    let single: Vec<f64> = steps
        .iter()
        .filter(|step| step.abs_diff(median) * 4 <= median)
        .map(|step| *step as f64)
        .collect();
    let step = single.iter().sum::<f64>() / single.len().max(1) as f64;
    let place = |number: usize| ((number - first) as f64 / step.max(1.0)).round();
    // Numbers that mostly follow each other are those of frames.
    if median <= 1 {
        return None;
    }
    let by_order = frames.len() == count;
    // A quarter of a step either way is a timer's jitter.
    let is_even = |seen: &FrameDetections| {
        ((seen.number - first) as f64 - place(seen.number) * step).abs() <= 0.25 * step
    };
    let by_steps =
        2 * single.len() >= steps.len() && place(last) < count as f64 && frames.iter().all(is_even);
    if !by_order && !by_steps {
        return None;
    }
    for (order, seen) in frames.iter_mut().enumerate() {
        seen.number = if by_order {
            order
        } else {
            place(seen.number) as usize
        };
    }
    Some(match by_order {
        true => format!(
            "numbers up to {last} in the pictures' names are no frames of the clip: its {count} frames are taken in their order"
        ),
        false => format!(
            "numbers up to {last} in the pictures' names are no frames of the clip but times: {step:.1} of them are taken for one frame, and {first} for \
             the first"
        ),
    })
}

/// Leaves out the few frames beyond the clip's end. A frame whose number is the clip's count stays unless there is a frame 0: it tells
/// that the detector counts from 1.
fn end(frames: &mut Vec<FrameDetections>, count: usize) -> Option<String> {
    if frames.last()?.number >= too_far(count) {
        return None;
    }
    let all = frames.len();
    let most = count + usize::from(frames.first()?.number > 0);
    frames.retain(|seen| seen.number < most);
    beyond("key points", all - frames.len(), count)
}

/// A person by the detector's number.
struct Numbered {
    name: String,
    /// All numbers that are the person's.
    names: Vec<String>,
    first: (usize, Detection),
    last: (usize, Detection),
    frames: usize,
}

/// Largest motion per frame and at once, as a share of the person's box.
const MOTION: [f64; 2] = [0.3, 0.1];

impl Track for Numbered {
    fn name(&self) -> &str {
        &self.name
    }

    fn ends(&self) -> Option<[usize; 2]> {
        Some([self.first.0, self.last.0])
    }

    fn distance(&self, next: &Self, gap: usize) -> f64 {
        let (Some(a), Some(b)) = (self.last.1.bounds(), next.first.1.bounds()) else {
            return f64::INFINITY;
        };
        let side = |[x0, y0, x1, y1]: [f64; 4]| (x1 - x0).max(y1 - y0);
        let size = side(a).max(side(b)).max(1.0);
        let ends = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        ends.fold(0.0, f64::max) / size / (MOTION[0] + MOTION[1] * gap as f64)
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

/// Gives one number to people whom the detector lost and found again.
fn join(frames: &mut [FrameDetections], notes: &mut Vec<String>) {
    let mut people: Vec<Numbered> = Vec::new();
    for seen in frames.iter() {
        for detection in &seen.people {
            let Some(name) = &detection.person else {
                return;
            };
            let here = (seen.number, detection.clone());
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
    for person in joined(people, notes).iter().filter(|it| it.names.len() > 1) {
        let all = frames.iter_mut().flat_map(|seen| &mut seen.people);
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
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(numbers: impl Iterator<Item = usize>) -> Vec<FrameDetections> {
        let frame = |number| FrameDetections {
            number,
            image: None,
            people: Vec::new(),
        };
        numbers.map(frame).collect()
    }

    fn numbers(frames: &[FrameDetections]) -> Vec<usize> {
        frames.iter().map(|seen| seen.number).collect()
    }

    #[test]
    fn times_in_names_become_frames() {
        let mut all = frames((0..10).map(|at| 231_935 + 41 * at * at));
        let note = times(&mut all, 10).expect("no numbers of frames");
        assert!(note.contains("in their order"), "{note}");
        assert_eq!(numbers(&all), (0..10).collect::<Vec<_>>());
        // With gaps, in steps of 33 or 34 milliseconds.
        let mut some = frames([0, 33, 67, 167, 200, 300].into_iter().map(|at| 5000 + at));
        let note = times(&mut some, 12).expect("times");
        assert!(
            note.contains("33.3 of them are taken for one frame"),
            "{note}"
        );
        assert_eq!(numbers(&some), [0, 1, 2, 5, 6, 9]);
        let mut stray = frames((0..15).chain([900]));
        assert_eq!(times(&mut stray, 16), None, "a frame of another clip");
        let mut wild = frames([0, 17, 1000, 1003, 5000].into_iter());
        assert_eq!(times(&mut wild, 12), None);
        assert_eq!(times(&mut frames(0..14), 12), None, "a few beyond the end");
    }

    #[test]
    fn a_few_beyond_the_end_are_left_out() {
        let said = |numbers: std::ops::Range<usize>| {
            let mut all = frames(numbers);
            (end(&mut all, 65), all.len())
        };
        let note = "3 frames of key points beyond the clip's 65: left out".to_owned();
        assert_eq!(said(0..68), (Some(note), 65));
        let note = "1 frame of key points beyond the clip's 65: left out".to_owned();
        assert_eq!(said(0..66), (Some(note), 65));
        assert_eq!(said(1..66), (None, 65), "numbers begin at 1");
        let mut other = frames(0..90);
        assert_eq!((end(&mut other, 65), other.len()), (None, 90));
    }

    #[test]
    fn a_person_with_two_numbers_is_one() {
        let detection = |name: &str, x: f64| Detection {
            person: Some(name.into()),
            picture: vec![[x, 10.0, 0.9], [x + 40.0, 110.0, 0.9]],
            space: Vec::new(),
            mask: None,
            own: None,
        };
        let mut all = frames((0..20).chain(22..42));
        for seen in &mut all {
            let name = if seen.number < 20 { "0" } else { "3" };
            seen.people = vec![detection(name, 50.0), detection("7", 400.0)];
        }
        let mut notes = Vec::new();
        join(&mut all, &mut notes);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].starts_with("person 0 goes on as 3"), "{notes:?}");
        let people = all.iter().flat_map(|seen| &seen.people);
        assert!(people.clone().all(|it| it.person.as_deref() != Some("3")));
        assert_eq!(
            people
                .filter(|it| it.person.as_deref() == Some("0"))
                .count(),
            40
        );
    }
}
