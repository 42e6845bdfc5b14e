//! Files that belong together: a detector writes one for each frame, named alike but for the frame's number. Another take in the same
//! folder has another name, and often the same numbers.

use std::collections::{BTreeMap, BTreeSet};

/// Which of the numbers in a file's name is the frame's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameNumber {
    /// The last one.
    Last,
    /// The one at this place. What follows it is of a person.
    At(usize),
}

impl FrameNumber {
    /// That of names in which the frame's number may be followed by a person's: the one that has most values.
    pub(super) fn of_most_values<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        let mut values: Vec<BTreeSet<usize>> = Vec::new();
        for name in names {
            for (at, (_, number)) in groups(name).into_iter().enumerate() {
                if values.len() <= at {
                    values.push(BTreeSet::new());
                }
                if let Some(values) = values.get_mut(at) {
                    values.insert(number);
                }
            }
        }
        let counts = values.iter().map(BTreeSet::len).enumerate();
        // The first of the longest.
        let best = counts.max_by_key(|(at, count)| (*count, std::cmp::Reverse(*at)));
        Self::At(best.map_or(0, |(at, _)| at))
    }

    /// What the names of a take have in common, and the frame's number.
    fn split(self, name: &str) -> (String, Option<usize>) {
        let groups = groups(name);
        let found = match self {
            Self::Last => groups.last(),
            Self::At(at) => groups.get(at),
        };
        let Some((start, number)) = found else {
            return (name.to_owned(), None);
        };
        let before = name.get(..*start).unwrap_or_default();
        let rest = name.get(*start..).unwrap_or_default();
        let after = rest.trim_start_matches(|it: char| it.is_ascii_digit());
        let take = match self {
            Self::Last => format!("{before}#{after}"),
            Self::At(_) => before.to_owned(),
        };
        (take, Some(*number))
    }

    /// The frame's number in a name.
    pub(super) fn of(self, name: &str) -> Option<usize> {
        self.split(name).1
    }

    /// Whether two names are of one take.
    pub(super) fn is_same_take(self, one: &str, other: &str) -> bool {
        self.split(one).0 == self.split(other).0
    }

    /// The places of two names of different takes with the same frame, if there are any.
    pub(super) fn clash<'a>(self, names: impl Iterator<Item = &'a str>) -> Option<[usize; 2]> {
        let mut of_number: BTreeMap<usize, (String, usize)> = BTreeMap::new();
        for (at, name) in names.enumerate() {
            let (take, Some(number)) = self.split(name) else {
                continue;
            };
            let (earlier, place) = of_number.entry(number).or_insert((take.clone(), at));
            if *earlier != take {
                return Some([*place, at]);
            }
        }
        None
    }
}

/// The numbers in a name, with the places where they begin.
fn groups(name: &str) -> Vec<(usize, usize)> {
    let mut groups = Vec::new();
    let mut from = 0;
    while let Some(start) = name
        .get(from..)
        .and_then(|rest| rest.find(|it: char| it.is_ascii_digit()))
    {
        let start = from + start;
        let rest = name.get(start..).unwrap_or_default();
        let length = rest
            .find(|it: char| !it.is_ascii_digit())
            .unwrap_or(rest.len());
        let digits = rest.get(..length).unwrap_or_default();
        // No frame has a number that is too long to be read.
        groups.push((start, digits.parse().unwrap_or(usize::MAX)));
        from = start + length;
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clash(number: FrameNumber, names: &[&str]) -> Option<[usize; 2]> {
        number.clash(names.iter().copied())
    }

    #[test]
    fn a_take_is_told_by_everything_but_the_frame_s_number() {
        let all = ["cam1_001.json", "cam1_002.json", "cam2_001.json"];
        let last = FrameNumber::Last;
        assert!(last.is_same_take(all[0], all[1]) && !last.is_same_take(all[0], all[2]));
        assert_eq!(
            clash(last, &all),
            Some([0, 2]),
            "both cameras have the frame 1"
        );
        assert_eq!(clash(last, &all[..2]), None);
        assert_eq!(
            clash(last, &["A_001.json", "B_002.json"]),
            None,
            "no frame twice"
        );
        assert_eq!(
            clash(last, &["alpha.json", "bravo.json"]),
            None,
            "no numbers"
        );
    }

    #[test]
    fn people_of_a_frame_are_of_its_take() {
        let number = |names: &[&str]| FrameNumber::of_most_values(names.iter().copied());
        for names in [
            [
                "frame_0000_subj00.npz",
                "frame_0000_subj01.npz",
                "frame_0001_subj00.npz",
            ],
            ["000003.npz", "000003_1.npz", "000004.npz"],
            ["f0000_left.npz", "f0000_right.npz", "f0001_left.npz"],
        ] {
            assert_eq!(number(&names), FrameNumber::At(0), "{names:?}");
            assert_eq!(clash(number(&names), &names), None, "{names:?}");
        }
        let cameras = ["cam1_0.npz", "cam1_1.npz", "cam1_2.npz", "cam2_0.npz"];
        let frames = number(&cameras);
        assert_eq!(
            (frames, frames.of(cameras[2])),
            (FrameNumber::At(1), Some(2))
        );
        assert!(clash(frames, &cameras).is_some(), "two cameras");
    }
}
