//! Numbers of frames: in the names of files, and in notes for people.

use std::path::Path;
use yoto_proto::text::count;

/// Numbers of frames are below this; longer ones in names are dates.
const MOST: usize = 1_000_000_000;

/// The last number in a file's name.
pub(crate) fn number_in(name: &str) -> Option<usize> {
    let stem = Path::new(name).file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let head = stem.get(..end)?;
    let start = head
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + 1);
    let number = head.get(start..)?.parse().ok();
    number.filter(|number| *number < MOST)
}

/// Runs of numbers for people: `3, 7–9`.
fn runs(numbers: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &number in numbers {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => runs.push((number, number)),
        }
    }
    let named = runs.iter().take(8).map(|(first, last)| {
        if first == last {
            first.to_string()
        } else {
            format!("{first}–{last}")
        }
    });
    let mut text = named.collect::<Vec<_>>().join(", ");
    if runs.len() > 8 {
        text += ", …";
    }
    text
}

/// Tells which of `frames` lack something.
pub(crate) fn left_out(
    frames: &[usize],
    what: &str,
    has: impl Fn(&usize) -> bool,
    notes: &mut Vec<String>,
) {
    let without: Vec<usize> = frames.iter().copied().filter(|frame| !has(frame)).collect();
    if !without.is_empty() {
        notes.push(format!(
            "left out: {} without {what} ({})",
            count(without.len(), "frame"),
            runs(&without)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_last_of_a_name() {
        assert_eq!(number_in("out/demo_2/frame_000012.jpg"), Some(12));
        assert_eq!(number_in("00001.json"), Some(1));
        assert_eq!(number_in("12b.png"), Some(12));
        assert_eq!(number_in("video.npz"), None);
        assert_eq!(number_in("20240131235959000.png"), None);
    }

    #[test]
    fn runs_are_short() {
        assert_eq!(runs(&[3, 7, 8, 9]), "3, 7–9");
        let many: Vec<usize> = (0..100).step_by(2).collect();
        assert!(runs(&many).ends_with("14, …"));
    }
}
