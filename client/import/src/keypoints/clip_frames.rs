//! Fits detections to the clip before anybody is chosen: numbers that are times, and frames beyond its end.

use super::detections::{Detections, FrameDetections};
use crate::clip::{Clip, beyond, too_far};

/// Changes `found` to the frames of the clip; the notes name the assumptions.
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
            "numbers up to {last} in the pictures' names are not frames of the clip: its {count} frames are taken in their order"
        ),
        false => format!(
            "numbers up to {last} in the pictures' names are not frames of the clip but times: {step:.1} of them are taken for one frame, and {first} for \
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
}
