//! Numbers that trackers give to one person, one after the other.
//!
//! A tracker that loses a person for some frames goes on with a new number. Two tracks belong to one person if the second begins
//! soon after the first ends, near the same place, and nobody else begins or ends there.

use yoto_proto::text::count;

/// Most frames between two tracks of one person.
const SOON: usize = 15;

/// The frames and positions of a tracked person.
pub(crate) trait PersonTrack {
    /// The tracker's number or name.
    fn name(&self) -> &str;
    /// First and last frame; `None` for a person who is never seen.
    fn ends(&self) -> Option<[usize; 2]>;
    /// The distance from the end of this track to the beginning of `next`, `gap` frames later; 1 and more is too far.
    fn distance(&self, next: &Self, gap: usize) -> f64;
    /// The difference between the colours at this end and at the beginning of `next`; 1 and more is another person. `None` where
    /// colours are not compared.
    fn looks(&self, _next: &Self) -> Option<f64> {
        None
    }
    /// Appends the frames of `next`.
    fn append(&mut self, next: Self);
    /// Number of frames.
    fn frames(&self) -> usize;
}

/// The distance from the end of `one` to the beginning of `next`, if `next` begins soon after and near.
pub(crate) fn follows<T: PersonTrack>(one: &T, next: &T) -> Option<f64> {
    let ([_, end], [start, _]) = (one.ends()?, next.ends()?);
    let gap = start
        .checked_sub(end)
        .filter(|gap| (1..=SOON).contains(gap))?;
    Some(one.distance(next, gap)).filter(|far| *far < 1.0)
}

/// Joins tracks of one person, under the first one's name; each with a note.
pub(crate) fn joined<T: PersonTrack>(mut tracks: Vec<T>, notes: &mut Vec<String>) -> Vec<T> {
    loop {
        let (mut pairs, mut others) = (Vec::new(), Vec::new());
        for (a, one) in tracks.iter().enumerate() {
            for (b, next) in tracks.iter().enumerate() {
                let Some(far) = follows(one, next).filter(|_| a != b) else {
                    continue;
                };
                match one.looks(next) {
                    Some(unlike) if unlike >= 1.0 => others.push(format!(
                        "person {} begins where person {} ends, in other colours: they are taken for two people",
                        next.name(),
                        one.name()
                    )),
                    _ => pairs.push((far, a, b)),
                }
            }
        }
        // Somebody with two ways on is not known to have taken either.
        let is_only = |(_, a, b): &&(f64, usize, usize)| {
            let rivals = pairs.iter().filter(|(_, c, d)| c == a || d == b);
            rivals.count() == 1
        };
        let Some(&(_, a, b)) = pairs.iter().find(is_only) else {
            notes.extend(others);
            return tracks;
        };
        let alike = tracks.get(a).zip(tracks.get(b));
        let alike = match alike.and_then(|(one, next)| one.looks(next)) {
            Some(_) => ", in the same colours",
            None => "",
        };
        let next = tracks.remove(b);
        let at = a - usize::from(b < a);
        let Some(one) = tracks.get_mut(at) else {
            return tracks;
        };
        if let (Some([_, end]), Some([start, _])) = (one.ends(), next.ends()) {
            notes.push(format!(
                "person {} goes on as {} ({} later, at the same place{alike}): both are taken for person {} ({})",
                one.name(),
                next.name(),
                count(start - end, "frame"),
                one.name(),
                count(one.frames() + next.frames(), "frame"),
            ));
        }
        one.append(next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A name and frames, each at a place.
    #[derive(Clone, Debug, PartialEq)]
    struct Dots(String, Vec<(usize, f64)>);

    impl PersonTrack for Dots {
        fn name(&self) -> &str {
            &self.0
        }

        fn ends(&self) -> Option<[usize; 2]> {
            Some([self.1.first()?.0, self.1.last()?.0])
        }

        fn distance(&self, next: &Self, gap: usize) -> f64 {
            let (Some(a), Some(b)) = (self.1.last(), next.1.first()) else {
                return f64::INFINITY;
            };
            (a.1 - b.1).abs() / gap as f64
        }

        fn append(&mut self, next: Self) {
            self.1.extend(next.1);
        }

        fn frames(&self) -> usize {
            self.1.len()
        }
    }

    fn dots(name: &str, frames: std::ops::Range<usize>, place: f64) -> Dots {
        Dots(name.into(), frames.map(|frame| (frame, place)).collect())
    }

    #[test]
    fn a_track_that_goes_on_is_one_person() {
        let mut notes = Vec::new();
        let tracks = vec![
            dots("3", 22..42, 0.5),
            dots("0", 0..20, 0.0),
            dots("9", 50..60, 0.5),
        ];
        let found = joined(tracks, &mut notes);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].name(), found[0].frames()), ("0", 50));
        assert!(
            notes
                .iter()
                .any(|note| note.starts_with("person 0 goes on as 3 (3 frames later")),
            "{notes:?}"
        );
    }

    #[test]
    fn others_stay_apart() {
        let apart = |tracks: Vec<Dots>| {
            let mut notes = Vec::new();
            let found = joined(tracks.clone(), &mut notes);
            assert_eq!((found, notes.len()), (tracks, 0));
        };
        // Elsewhere, much later, at the same time, and two to choose from.
        apart(vec![dots("0", 0..20, 0.0), dots("1", 22..42, 9.0)]);
        apart(vec![dots("0", 0..20, 0.0), dots("1", 60..80, 0.0)]);
        apart(vec![dots("0", 0..20, 0.0), dots("1", 10..30, 0.0)]);
        apart(vec![
            dots("0", 0..20, 0.0),
            dots("1", 22..42, 0.5),
            dots("2", 23..42, 0.4),
        ]);
    }
}
