//! Colours of the surface that no frame shows: what people have there by the decoder that they share, and what the surface
//! around, and that of the body's other side, has beyond it. Points of the same part of the body count by their nearness. People
//! are more alike along a ring around a limb or the trunk than along the limb: a jacket ends at the same height in front and
//! behind. What frames hardly show is between its own colour and such a guess.

use crate::decoder::Decoder;
use crate::decoder::cells::Means;
use crate::decoder::parts::{PARTS, Parts};
use rayon::prelude::*;

/// Number of points of a side that a guess is the mean of.
const MANY: usize = 48;
/// How much farther points count along the part than around it.
const ALONG: f32 = 3.0;
/// Distance below which all points count alike, metres.
const NEAR: f32 = 0.02;
/// Evidence, as a multiple of what is firm, from which a colour is its own alone, and beyond which more counts no more.
const SURE: f32 = 4.0;

/// The splats of a person in the rest pose.
pub(super) struct Surface {
    /// Metres.
    pub points: Vec<[f32; 3]>,
    pub colours: Vec<[f32; 3]>,
    /// The part of the body that each belongs to: the bone that carries most of it, or the decoder's part.
    pub parts: Vec<usize>,
    /// Whether the splat is drawn at all.
    pub shown: Vec<bool>,
    /// Opacity times area, m².
    pub opaque: Vec<f32>,
    /// Whether it is opaque enough to tell a colour.
    pub solid: Vec<bool>,
    /// Whether a frame shows it.
    pub seen: Vec<bool>,
    /// Whether what frames hardly show is drawn towards a guess.
    pub drawn: bool,
    /// How much frames show of it; its colour is firm from 1 on.
    pub evidence: Vec<f32>,
    /// Unit direction of each part.
    pub axes: Vec<[f32; 3]>,
    /// None if the body has no two sides.
    pub mirror: Option<Mirror>,
    /// The colour of each splat by the decoder; `None` without one.
    pub expected: Option<Vec<[f32; 3]>>,
}

/// The symmetry of a body about a plane of constant x.
pub(super) struct Mirror {
    /// Metres.
    pub middle: f32,
    /// The part on the other side.
    pub other: Vec<usize>,
}

/// Colours with guesses, and how many there are.
pub(super) struct Guessed {
    /// `[N, 3]`.
    pub colours: Vec<f32>,
    /// Whether the splat's is guessed.
    pub anew: Vec<bool>,
    /// Number of splats that are drawn.
    pub shown: usize,
    /// Number of those guessed from the other side above all.
    pub mirrored: usize,
    /// Whether the decoder took part.
    pub decoded: bool,
}

/// A likely colour.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Guess {
    colour: [f32; 3],
    /// Whether most of it is from the other side.
    mirrored: bool,
}

/// A sum of colours by weights.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    colour: [f32; 3],
    weight: f32,
}

impl Surface {
    /// Takes the decoder's parts of the body in place of `bones`, and its colours for a person who looks like this one
    /// where frames show them well.
    pub(super) fn by_parts(&mut self, decoder: &Decoder, parts: &Parts, bones: &[usize]) {
        let places = self.points.iter().zip(bones);
        let places: Vec<_> = places.map(|(at, bone)| parts.place(*at, *bone)).collect();
        let weight = |index: usize| self.opaque[index] * self.evidence[index].min(SURE);
        let sources = (0..places.len()).filter(|index| self.tells(*index));
        let means = Means::of(sources.map(|i| (places[i], self.colours[i], weight(i))));
        let person = decoder.of_person(&means);
        self.expected = Some(places.iter().map(|place| person.colour(*place)).collect());
        self.parts = places.iter().map(|place| place.part).collect();
        self.axes = (0..PARTS).map(|part| parts.along(part)).collect();
        if let Some(mirror) = &mut self.mirror {
            mirror.other = (0..PARTS).map(Parts::other).collect();
        }
    }

    /// Whether the splat's colour is firm, so that others are guessed from it.
    fn tells(&self, index: usize) -> bool {
        self.seen[index] && self.solid[index] && self.evidence[index] >= 1.0
    }

    /// Its colours, guessed where nothing is seen, and drawn towards what is likely where little is. Nothing is guessed if no
    /// colour is firm.
    pub(super) fn guessed(&self) -> Guessed {
        let indices = 0..self.points.len();
        let all: Vec<usize> = indices.clone().filter(|index| self.tells(*index)).collect();
        let mut by_part = vec![Vec::new(); self.axes.len()];
        for index in &all {
            by_part[self.parts[*index]].push(*index);
        }
        let guess = |index: usize| {
            let asked = self.shown[index]
                && (!self.seen[index] || self.drawn && self.evidence[index] < SURE);
            asked.then(|| self.likely(index, &by_part, &all))?
        };
        let guesses: Vec<Option<Guess>> = indices.clone().into_par_iter().map(guess).collect();
        let anew = |index: usize| guesses[index].filter(|_| !self.seen[index]);
        let colour = |index: usize| match guesses[index] {
            Some(guess) if self.seen[index] => self.between(index, guess.colour),
            Some(guess) => guess.colour,
            None => self.colours[index],
        };
        Guessed {
            shown: self.shown.iter().filter(|shown| **shown).count(),
            mirrored: (indices.clone().filter_map(anew))
                .filter(|guess| guess.mirrored)
                .count(),
            anew: indices.clone().map(|index| anew(index).is_some()).collect(),
            colours: indices.flat_map(colour).collect(),
            decoded: self.expected.is_some(),
        }
    }

    /// The colour of a splat that frames show a little of: the mean of its own, by the evidence, and of the guess, by as much
    /// as makes a colour firm and less the more evidence there is.
    fn between(&self, index: usize, guess: [f32; 3]) -> [f32; 3] {
        let own = self.evidence[index];
        let drawn = (1.0 - own / SURE).max(0.0);
        let part = drawn / (own + drawn).max(f32::MIN_POSITIVE);
        let colour = self.colours[index];
        std::array::from_fn(|c| colour[c] + part * (guess[c] - colour[c]))
    }

    /// The likely colour of a splat, from firm ones of its part and of the part on the other side, or of `all` if there are
    /// none.
    fn likely(&self, index: usize, by_part: &[Vec<usize>], all: &[usize]) -> Option<Guess> {
        let at = self.points[index];
        let part = self.parts[index];
        let own = self.sum(at, Some(self.axes[part]), &by_part[part]);
        let across = self.mirror.as_ref().map_or(Sum::default(), |mirror| {
            let [x, y, z] = at;
            let [a, b, c] = self.axes[part];
            let at = [2.0 * mirror.middle - x, y, z];
            self.sum(at, Some([-a, b, c]), &by_part[mirror.other[part]])
        });
        let both = match own.weight + across.weight > 0.0 {
            true => Sum {
                colour: std::array::from_fn(|c| own.colour[c] + across.colour[c]),
                weight: own.weight + across.weight,
            },
            false => self.sum(at, None, all),
        };
        let expected = self.expected(index);
        (both.weight > 0.0).then(|| Guess {
            colour: std::array::from_fn(|c| expected[c] + both.colour[c] / both.weight),
            mirrored: across.weight > own.weight,
        })
    }

    /// The colour of a splat by the decoder; black without one.
    fn expected(&self, index: usize) -> [f32; 3] {
        self.expected.as_ref().map_or([0.0; 3], |all| all[index])
    }

    /// The sum of what the [`MANY`] points of `among` that are nearest to `at` have beyond the decoder, by nearness and
    /// evidence. Distances along an `axis` count more.
    fn sum(&self, at: [f32; 3], axis: Option<[f32; 3]>, among: &[usize]) -> Sum {
        let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        let squared = |index: usize| {
            let off: [f32; 3] = std::array::from_fn(|a| self.points[index][a] - at[a]);
            let along = axis.map_or(0.0, |axis| dot(off, axis));
            dot(off, off) + (ALONG * ALONG - 1.0) * along * along
        };
        let mut near: Vec<(f32, usize)> = among
            .iter()
            .map(|index| (squared(*index), *index))
            .collect();
        let nearer = |(a, i): &(f32, usize), (b, j): &(f32, usize)| a.total_cmp(b).then(i.cmp(j));
        if near.len() > MANY {
            near.select_nth_unstable_by(MANY, nearer);
            near.truncate(MANY);
        }
        near.sort_unstable_by(nearer);
        let mut sum = Sum::default();
        for (squared, index) in near {
            let weight = self.evidence[index].min(SURE) / (squared + NEAR * NEAR);
            let expected = self.expected(index);
            let beyond = self.colours[index].iter().zip(expected);
            for (sum, (own, expected)) in sum.colour.iter_mut().zip(beyond) {
                *sum += weight * (own - expected);
            }
            sum.weight += weight;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two arms along x, left (bone 1) and right (bone 2), of rings of four points; the bone of each point is given.
    fn arms(seen: impl Fn([f32; 3]) -> bool) -> Surface {
        let (mut points, mut colours, mut bones) = (Vec::new(), Vec::new(), Vec::new());
        for (bone, side) in [(1, 1.0f32), (2, -1.0)] {
            for step in 0..80 {
                for [y, z] in [[0.04, 0.0], [-0.04, 0.0], [0.0, 0.04], [0.0, -0.04]] {
                    points.push([side * (0.2 + 0.005 * step as f32), y, z]);
                    // Sleeves to half of the arm, in the colour of their side.
                    let sleeve = if step < 40 { 1.0 } else { 0.0 };
                    colours.push([sleeve, if bone == 1 { 0.5 } else { 0.7 }, 0.2]);
                    bones.push(bone);
                }
            }
        }
        Surface {
            seen: points.iter().map(|point| seen(*point)).collect(),
            drawn: true,
            evidence: vec![SURE; points.len()],
            opaque: vec![1e-4; points.len()],
            solid: vec![true; points.len()],
            expected: None,
            shown: vec![true; points.len()],
            axes: vec![[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
            mirror: Some(Mirror {
                middle: 0.0,
                other: vec![0, 2, 1],
            }),
            points,
            colours,
            parts: bones,
        }
    }

    fn count(guessed: &Guessed) -> usize {
        guessed.anew.iter().filter(|anew| **anew).count()
    }

    #[test]
    fn an_unseen_side_looks_as_the_other() {
        let arms = arms(|[x, ..]| x > 0.0);
        let guessed = arms.guessed();
        assert_eq!(
            (guessed.shown, guessed.mirrored, count(&guessed)),
            (640, 320, 320)
        );
        let colours = guessed.colours.as_chunks::<3>().0;
        for (index, point) in arms.points.iter().enumerate() {
            let [sleeve, side, _] = colours[index];
            assert!((side - 0.5).abs() < 1e-5, "as on the left side");
            let expected = if point[0].abs() < 0.37 { 1.0 } else { 0.0 };
            if (point[0].abs() - 0.39).abs() > 0.08 {
                assert!((sleeve - expected).abs() < 1e-5, "{point:?}: {sleeve}");
            }
        }
    }

    #[test]
    fn an_unseen_back_has_the_colours_of_the_ring_around() {
        let arms = arms(|[_, _, z]| z > 0.0);
        let guessed = arms.guessed();
        assert_eq!((guessed.mirrored, count(&guessed)), (0, 480));
        for (point, colour) in arms.points.iter().zip(guessed.colours.as_chunks::<3>().0) {
            let off = point[0].abs() - 0.39;
            if off.abs() > 0.08 {
                let expected = if off < 0.0 { 1.0 } else { 0.0 };
                assert!((colour[0] - expected).abs() < 0.2, "{point:?}: {colour:?}");
            }
        }
    }

    #[test]
    fn what_is_seen_stays_and_what_is_not_drawn_is_left() {
        let mut arms = arms(|[x, ..]| x > 0.0);
        arms.shown[639] = false;
        let guessed = arms.guessed();
        let colours = guessed.colours.as_chunks::<3>().0;
        assert_eq!(colours[..320], arms.colours[..320]);
        assert_eq!(colours[159], arms.colours[159]);
        arms.seen.fill(false);
        let nothing = arms.guessed();
        assert_eq!(count(&nothing), 0);
    }

    #[test]
    fn what_is_hardly_seen_tells_nothing_and_is_drawn_to_what_is_likely() {
        let mut arms = arms(|[_, _, z]| z > 0.0);
        // A stripe of the front in a colour that nothing else has.
        let (front, back) = (2, 3);
        assert!(arms.seen[front] && !arms.seen[back]);
        let stripe = || (0..10).map(|ring| 4 * ring + front);
        stripe().for_each(|index| arms.colours[index] = [0.0, 0.0, 1.0]);
        let blue = |arms: &Surface, index: usize| arms.guessed().colours[3 * index + 2];
        assert!(
            blue(&arms, back) > 0.25,
            "a firm colour is carried to the back"
        );
        stripe().for_each(|index| arms.evidence[index] = 0.5);
        assert!((blue(&arms, back) - 0.2).abs() < 1e-5, "another is not");
        let drawn = blue(&arms, front);
        assert!((0.3..0.7).contains(&drawn), "between 1 and 0.2: {drawn}");
        arms.drawn = false;
        assert_eq!(blue(&arms, front), 1.0);
        arms.drawn = true;
        arms.evidence[front] = SURE;
        assert_eq!(blue(&arms, front), 1.0, "what is sure stays");
    }
}
