//! The people of a clip, and the identity of a body in a picture.
//!
//! A search from picture to picture may find another person after it lost the first. So the sequence of bodies is cut
//! where a body is too far from the one before to be the same, and the parts are joined again where place or colours allow it.

use crate::colours::{OTHER_COLOURS, difference};

/// Colours of torso and legs as lightness and two differences of red, green and blue; `None` where they are not seen.
pub(crate) type Colours = [Option<[f32; 3]>; 2];

/// A body in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySquare {
    /// The middle of the hips, pixels.
    pub hips: [f32; 2],
    /// Side of the square around the body, pixels.
    pub side: f32,
    pub(crate) colours: Colours,
}

/// A person in some pictures of a clip.
#[derive(Clone, Debug)]
pub struct PersonTrack {
    /// Number of the picture and figure, in ascending order.
    pub seen: Vec<(usize, BodySquare)>,
}

/// Motion between two pictures, as a share of the body's square: at once, and for each picture in between. At 30 frames per second a
/// sprinter covers a tenth of it per frame.
const MOTION: [f32; 2] = [0.3, 0.1];
/// Largest motion that is followed, however long it took.
const FARTHEST: f32 = 1.5;
/// Within this number of pictures, nobody returns at another place.
const SOON: usize = 30;
/// Largest change of size, natural logarithm.
const GROWTH: f32 = 0.6;
/// Bodies that were lost in between are the same person if their colours differ by less than this.
const SAME_COLOURS: f32 = 1.5;
/// After this number of consecutive pictures without the person, colours decide whether a body is the same person.
const LOST: usize = 3;
/// A body is taken for another person if it resembles them more by at least this, spreads.
const CLEARLY: f32 = 0.5;
/// Another person must be seen in at least this number of pictures: others may be shadows.
const FEWEST: usize = 2;
/// Bodies nearer than this, as a share of the square, are at one place.
const TOUCHING: f32 = 0.15;

impl BodySquare {
    /// Side of the square over the body's length.
    pub const MARGIN: f32 = crate::region::MARGIN;

    /// Distance of places, as a share of the larger square.
    fn distance(&self, other: &Self) -> f32 {
        let [dx, dy] = [0, 1].map(|axis| self.hips[axis] - other.hips[axis]);
        dx.hypot(dy) / self.side.max(other.side).max(1.0)
    }

    fn growth(&self, other: &Self) -> f32 {
        (self.side.max(1.0) / other.side.max(1.0)).ln().abs()
    }

    /// Differences of the colours of the parts that are seen in both, spreads.
    fn differences(&self, other: &Self) -> impl Iterator<Item = f32> {
        let parts = self.colours.iter().zip(&other.colours);
        parts.filter_map(|(one, other)| Some(difference(one.as_ref()?, other.as_ref()?)))
    }

    /// Difference of colours, spreads; `None` if no part is seen in both.
    fn difference(&self, other: &Self) -> Option<f32> {
        let count = self.differences(other).count();
        (count > 0).then(|| self.differences(other).sum::<f32>() / count as f32)
    }

    /// Whether a body gets here from `before` in a number of pictures.
    fn is_reached(&self, before: &Self, pictures: usize) -> bool {
        self.distance(before) < allowed(pictures) && self.growth(before) < GROWTH
    }
}

impl PersonTrack {
    /// The person's weight: number of pictures times size.
    fn weight(&self) -> f32 {
        self.seen.iter().map(|(_, figure)| figure.side).sum()
    }

    /// The difference of colours to the figure seen that is most alike.
    fn difference(&self, figure: &BodySquare) -> Option<f32> {
        let all = self.seen.iter();
        all.filter_map(|(_, seen)| seen.difference(figure))
            .min_by(f32::total_cmp)
    }

    /// Where the person is in the picture `at`, between two in which they are seen, at most `gap` apart.
    fn figure_at(&self, at: usize, gap: usize) -> Option<BodySquare> {
        let next = self.seen.partition_point(|(picture, _)| *picture < at);
        let after = self.seen.get(next);
        if let Some((picture, figure)) = after
            && *picture == at
        {
            return Some(*figure);
        }
        let ((first, a), (last, b)) = (self.seen.get(next.checked_sub(1)?)?, after?);
        if last - first > gap {
            return None;
        }
        let share = (at - first) as f32 / (last - first) as f32;
        let mixed = |a: f32, b: f32| a + share * (b - a);
        Some(BodySquare {
            hips: [0, 1].map(|axis| mixed(a.hips[axis], b.hips[axis])),
            side: mixed(a.side, b.side),
            colours: [None; 2],
        })
    }

    /// Whether the figure wears what the person never does: some part is of another colour than in all pictures that show the
    /// most parts of both. An arm before the torso gives it skin's colour in some, often where the legs are hidden.
    fn is_unlike(&self, figure: &BodySquare) -> bool {
        let parts = |seen: &BodySquare| seen.differences(figure).count();
        let all = || self.seen.iter().map(|(_, seen)| seen);
        let most = all().map(parts).max().unwrap_or(0);
        let telling = all().filter(|seen| most > 0 && parts(seen) == most);
        let worst = telling.map(|seen| seen.differences(figure).fold(0.0, f32::max));
        worst
            .min_by(f32::total_cmp)
            .is_some_and(|it| it > OTHER_COLOURS)
    }

    /// Whether the figure in the picture `at`, after the last cut at `cut`, can be the person, who was lost before.
    fn comes_back(&self, at: usize, figure: &BodySquare, cut: usize) -> bool {
        let Some((last, before)) = self.seen.last() else {
            return false;
        };
        let is_cut = *last < cut;
        if !is_cut && figure.is_reached(before, at - last) {
            return !self.is_unlike(figure);
        }
        let colours = self.difference(figure).unwrap_or(0.0);
        (is_cut || at - last > SOON) && colours < SAME_COLOURS
    }
}

/// A body found in one picture.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// Number of the picture.
    pub at: usize,
    /// The body.
    pub figure: BodySquare,
    /// Whether the picture shows another scene than the sighting before, or the same from elsewhere: then a body may be anywhere.
    pub is_cut: bool,
}

/// The people of a clip, those who are largest and seen longest first, from one sighting per picture, in ascending order.
pub fn people(sightings: &[Sighting]) -> Vec<PersonTrack> {
    let mut people: Vec<PersonTrack> = Vec::new();
    let mut current = None;
    let mut last_cut = 0;
    let mut before: Option<(usize, BodySquare)> = None;
    // Of pictures that follow each other.
    let steps = sightings.windows(2).map(|pair| pair[1].at - pair[0].at);
    let lost = LOST * steps.min().unwrap_or(1).max(1);
    for &Sighting { at, figure, is_cut } in sightings {
        if is_cut {
            last_cut = at;
        }
        // Somebody else may come to where a body was lost; one that is followed keeps its place in odd light.
        let is_other = |last: usize| {
            let person = current.and_then(|index| people.get(index));
            at - last > lost && person.is_some_and(|person: &PersonTrack| person.is_unlike(&figure))
        };
        let is_same_body = |(last, before): &(usize, BodySquare)| {
            figure.is_reached(before, at - last) && !is_other(*last)
        };
        if is_cut || !before.as_ref().is_some_and(is_same_body) {
            current = people
                .iter()
                .position(|person| person.comes_back(at, &figure, last_cut));
        }
        match current.and_then(|index| people.get_mut(index)) {
            Some(person) => person.seen.push((at, figure)),
            None => {
                current = Some(people.len());
                people.push(PersonTrack {
                    seen: vec![(at, figure)],
                });
            }
        }
        before = Some((at, figure));
    }
    people.sort_by(|a, b| b.weight().total_cmp(&a.weight()));
    people
}

/// Largest motion over a number of pictures, as a share of the body's square.
fn allowed(pictures: usize) -> f32 {
    (MOTION[0] + MOTION[1] * pictures as f32).min(FARTHEST)
}

/// One of several people, distinguished from the others.
#[derive(Clone, Debug)]
pub struct Target {
    person: PersonTrack,
    others: Vec<PersonTrack>,
    /// A person's place is interpolated between pictures at most this number apart.
    gap: usize,
    /// The last picture and place of the person.
    last: Option<(usize, BodySquare)>,
}

impl Target {
    /// The person `index` of `people`, whose pictures are at most `step` apart. `None` without others who are seen more than once: then
    /// any person found is the one.
    pub fn new(people: &[PersonTrack], index: usize, step: usize) -> Option<Self> {
        let person = people.get(index)?.clone();
        let is_other =
            |(at, other): &(usize, &PersonTrack)| *at != index && other.seen.len() >= FEWEST;
        let others = people.iter().enumerate().filter(is_other);
        let others: Vec<PersonTrack> = others.map(|(_, other)| other.clone()).collect();
        (!others.is_empty()).then_some(Self {
            person,
            others,
            gap: SOON.max(2 * step),
            last: None,
        })
    }

    /// Tells that the figure in the picture `at` is the person.
    pub(crate) fn saw(&mut self, at: usize, figure: BodySquare) {
        self.last = Some((at, figure));
    }

    /// Whether the person was told a short while ago, too far away to be the figure in the picture `at`.
    fn is_too_soon(&self, at: usize, figure: &BodySquare) -> bool {
        self.last.is_some_and(|(last, before)| {
            let passed = at.saturating_sub(last);
            passed <= self.gap && !figure.is_reached(&before, passed)
        })
    }

    /// Distance of the figure in the picture `at` from where the person is: as seen before and after, else not far from where they
    /// were told last.
    fn own_place(&self, at: usize, figure: &BodySquare) -> Option<f32> {
        let seen = self.person.figure_at(at, self.gap);
        seen.map(|expected| figure.distance(&expected)).or_else(|| {
            let (last, before) = self.last?;
            let passed = at.checked_sub(last)?;
            let moved = figure.distance(&before);
            (passed <= self.gap && moved < allowed(passed)).then_some(moved)
        })
    }

    /// Whether the figure in the picture `at` is the person: nearer to their place than to that of others, and not more like
    /// another in its colours.
    pub(crate) fn is_person(&self, at: usize, figure: &BodySquare) -> bool {
        self.cost(at, figure).is_some()
    }

    /// The distance of the body in the picture `at` from the person's place and colours; `None` if it is another person, or undecided.
    pub(crate) fn cost(&self, at: usize, figure: &BodySquare) -> Option<f32> {
        let place = |person: &PersonTrack| {
            let expected = person.figure_at(at, self.gap)?;
            Some(figure.distance(&expected))
        };
        let own_place = self.own_place(at, figure);
        let other_place = self.others.iter().filter_map(place).min_by(f32::total_cmp);
        let own = self.person.difference(figure).unwrap_or(1.0);
        let others = self.others.iter();
        let other = others
            .filter_map(|person| person.difference(figure))
            .min_by(f32::total_cmp);
        let is_like_another = other.is_some_and(|other| own > other + CLEARLY);
        let is_nearer_another = match (own_place, other_place) {
            (Some(own), Some(other)) => own > other,
            // The others' places are known and the person's is not: at such a place is another.
            (None, Some(other)) => other < TOUCHING,
            _ => false,
        };
        let is_where_expected = own_place.is_some_and(|own| own < TOUCHING) && !is_nearer_another;
        // Colours decide where places don't, since light changes colours: without a place, they have to be the person's.
        let is_unlike = match own_place {
            Some(_) => own > OTHER_COLOURS,
            None => {
                own > SAME_COLOURS
                    || other.is_some_and(|other| own + CLEARLY > other)
                    || self.is_too_soon(at, figure)
            }
        };
        let is_other = is_nearer_another || (!is_where_expected && (is_like_another || is_unlike));
        (!is_other).then(|| own + own_place.unwrap_or(0.5))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [f32; 3] = [110.0, 90.0, 40.0];
    const BLUE: [f32; 3] = [90.0, -40.0, -70.0];

    fn figure(x: f32, torso: [f32; 3]) -> BodySquare {
        BodySquare {
            hips: [x, 300.0],
            side: 400.0,
            colours: [Some(torso), None],
        }
    }

    fn sighting(at: usize, figure: BodySquare) -> Sighting {
        Sighting {
            at,
            figure,
            is_cut: false,
        }
    }

    /// A dancer in red at 300, followed up to picture 40; then a bystander in blue at 1200.
    fn two() -> Vec<PersonTrack> {
        let red = (0..=40).map(|at| sighting(at, figure(300.0, RED)));
        let blue = (41..=60).map(|at| sighting(at, figure(1200.0, BLUE)));
        people(&red.chain(blue).collect::<Vec<_>>())
    }

    #[test]
    fn who_is_suddenly_elsewhere_is_somebody_else() {
        let seen = |people: Vec<PersonTrack>| -> Vec<usize> {
            people.iter().map(|person| person.seen.len()).collect()
        };
        assert_eq!(seen(two()), [41, 20]);
        // Even in the same clothes, but not after another scene, and not after a while.
        let mut twice = vec![
            sighting(0, figure(300.0, RED)),
            sighting(1, figure(1200.0, RED)),
        ];
        assert_eq!(seen(people(&twice)), [1, 1]);
        twice[1].is_cut = true;
        assert_eq!(seen(people(&twice)), [2]);
        twice[1] = sighting(60, figure(1200.0, RED));
        assert_eq!(seen(people(&twice)), [2]);
        twice[1] = sighting(60, figure(1200.0, BLUE));
        assert_eq!(seen(people(&twice)), [1, 1]);
    }

    #[test]
    fn who_comes_to_where_somebody_was_lost_is_told_by_colours() {
        // In red up to picture 40, then, after some without anybody, at the same place; the camera sees one picture in `step`.
        let back = |gap: usize, step: usize, torso: [f32; 3]| -> Vec<usize> {
            let red = (0..=40).map(|at| sighting(step * at, figure(300.0, RED)));
            let after = (40 + gap..60).map(|at| sighting(step * at, figure(310.0, torso)));
            let found = people(&red.chain(after).collect::<Vec<_>>());
            found.iter().map(|person| person.seen.len()).collect()
        };
        for step in [1, 3] {
            assert_eq!(back(8, step, RED), [53]);
            assert_eq!(back(8, step, BLUE), [41, 12]);
            // A body that is followed stays the same in other light.
            assert_eq!(back(1, step, BLUE), [60]);
        }
    }

    #[test]
    fn an_arm_before_the_torso_makes_nobody_alike() {
        let wears = |torso, legs| BodySquare {
            colours: [Some(torso), legs],
            ..figure(300.0, torso)
        };
        let skin = [140.0, 12.0, 2.0];
        // In red and white; from the side the legs are hidden, and the torso has the arm's colour.
        let dressed = |at: usize| match at % 10 {
            0 => wears(skin, None),
            _ => wears(RED, Some([150.0, 0.0, 0.0])),
        };
        let first = (0..=40).map(|at| sighting(at, dressed(at)));
        let grey = wears([110.0, 0.0, -5.0], Some([130.0, -32.0, -56.0]));
        let other = (48..60).map(|at| sighting(at, grey));
        let found = people(&first.chain(other).collect::<Vec<_>>());
        let seen: Vec<usize> = found.iter().map(|person| person.seen.len()).collect();
        assert_eq!(seen, [41, 12]);
    }

    #[test]
    fn a_moving_body_stays_one_person_and_a_slip_is_none() {
        let mut runs: Vec<Sighting> = (0..50)
            .map(|at| sighting(at, figure(30.0 * at as f32, RED)))
            .collect();
        assert_eq!(people(&runs).len(), 1);
        runs[20].figure = figure(3000.0, RED);
        let found = people(&runs);
        assert_eq!((found.len(), found[0].seen.len()), (2, 49));
        assert!(Target::new(&found, 0, 1).is_none(), "a slip is nobody");
    }

    #[test]
    fn the_largest_who_is_seen_longest_comes_first() {
        let small = BodySquare {
            side: 100.0,
            ..figure(1200.0, BLUE)
        };
        let large = (0..10).map(|at| sighting(at, figure(300.0, RED)));
        let small = (10..40).map(|at| sighting(at, small));
        let found = people(&large.chain(small).collect::<Vec<_>>());
        assert_eq!(found[0].seen.len(), 10);
    }

    #[test]
    fn one_person_is_told_from_the_other() {
        let mut target = Target::new(&two(), 0, 1).expect("not alone");
        assert!(target.is_person(7, &figure(310.0, RED)));
        assert!(!target.is_person(45, &figure(1190.0, BLUE)));
        // Another in the person's clothes at the other's place; the person in another light at their own.
        assert!(!target.is_person(45, &figure(1190.0, RED)));
        assert!(target.is_person(7, &figure(305.0, [60.0, 60.0, 20.0])));
        // Where no place is known, by the colours.
        assert!(target.is_person(90, &figure(700.0, RED)));
        assert!(!target.is_person(90, &figure(300.0, BLUE)));
        // But not at once on the other side of the picture.
        target.saw(85, figure(2700.0, RED));
        assert!(!target.is_person(90, &figure(700.0, RED)));
        assert!(target.is_person(90, &figure(2600.0, RED)));
        assert!(
            Target::new(&two(), 5, 1).is_none(),
            "nobody has this number"
        );
    }
}
