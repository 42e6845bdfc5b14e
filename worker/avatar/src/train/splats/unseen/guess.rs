//! Colours of the surface that no frame shows: those of the mirrored point on the body's other side if it is seen,
//! else those of the nearest seen points of the same part of the body. People are more alike along a ring around a
//! limb or the trunk than along the limb: a jacket ends at the same height in front and behind.

use rayon::prelude::*;

/// Farthest seen point from the mirrored one that says what is there, metres.
const MIRRORED: f32 = 0.03;
/// Number of points that a mirrored colour is the mean of.
const FEW: usize = 12;
/// Number of points that another one is the mean of.
const MANY: usize = 48;
/// How much farther points count along the bone than around it.
const ALONG: f32 = 3.0;
/// Distance below which all points count alike, metres.
const NEAR: f32 = 0.02;

/// The splats of a person in the rest pose.
pub(super) struct Surface {
    /// Metres.
    pub points: Vec<[f32; 3]>,
    pub colours: Vec<[f32; 3]>,
    /// The bone that carries most of each.
    pub bones: Vec<usize>,
    /// Whether the splat is drawn at all.
    pub shown: Vec<bool>,
    /// Whether a frame shows it.
    pub seen: Vec<bool>,
    /// Unit direction of each bone.
    pub axes: Vec<[f32; 3]>,
    /// None if the body has no two sides.
    pub mirror: Option<Mirror>,
}

/// The symmetry of a body about a plane of constant x.
pub(super) struct Mirror {
    /// Metres.
    pub middle: f32,
    /// The bone on the other side.
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
    /// Number of those guessed from the other side.
    pub mirrored: usize,
}

/// Where a guess is from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Guess {
    Mirrored([f32; 3]),
    Around([f32; 3]),
}

impl Surface {
    /// Its colours, guessed where nothing is seen. Nothing is guessed if nothing is seen at all.
    pub fn guessed(&self) -> Guessed {
        let indices = 0..self.points.len();
        let of_bone = |bone: usize| -> Vec<usize> {
            let seen = |index: &usize| {
                self.seen[*index] && self.shown[*index] && self.bones[*index] == bone
            };
            indices.clone().filter(seen).collect()
        };
        let by_bone: Vec<Vec<usize>> = (0..self.axes.len()).map(of_bone).collect();
        let all: Vec<usize> = by_bone.concat();
        let guess = |index: usize| {
            let asked = self.shown[index] && !self.seen[index];
            asked.then(|| {
                self.mirrored(index, &by_bone)
                    .or_else(|| self.around(index, &by_bone, &all))
            })?
        };
        let guesses: Vec<Option<Guess>> = indices.clone().into_par_iter().map(guess).collect();
        let mirrored = guesses.iter().flatten();
        let mirrored = mirrored.filter(|it| matches!(it, Guess::Mirrored(_)));
        let colour = |(own, guess): (&[f32; 3], &Option<Guess>)| match guess {
            Some(Guess::Mirrored(colour) | Guess::Around(colour)) => *colour,
            None => *own,
        };
        Guessed {
            shown: self.shown.iter().filter(|shown| **shown).count(),
            mirrored: mirrored.count(),
            anew: guesses.iter().map(Option::is_some).collect(),
            colours: self.colours.iter().zip(&guesses).flat_map(colour).collect(),
        }
    }

    fn mirrored(&self, index: usize, by_bone: &[Vec<usize>]) -> Option<Guess> {
        let mirror = self.mirror.as_ref()?;
        let [x, y, z] = self.points[index];
        let at = [2.0 * mirror.middle - x, y, z];
        let bone = mirror.other[self.bones[index]];
        let near = self.nearest(at, None, &by_bone[bone], FEW);
        let (first, _) = near.first()?;
        (*first <= MIRRORED * MIRRORED).then(|| Guess::Mirrored(self.mean(&near)))
    }

    fn around(&self, index: usize, by_bone: &[Vec<usize>], all: &[usize]) -> Option<Guess> {
        let bone = self.bones[index];
        let own = &by_bone[bone];
        let among = if own.len() < MANY { all } else { own };
        let near = self.nearest(self.points[index], Some(self.axes[bone]), among, MANY);
        (!near.is_empty()).then(|| Guess::Around(self.mean(&near)))
    }

    /// The `count` indices of `among` that are nearest to `at`, with the squares of their distances, in which the
    /// part along an `axis` counts more.
    fn nearest(
        &self,
        at: [f32; 3],
        axis: Option<[f32; 3]>,
        among: &[usize],
        count: usize,
    ) -> Vec<(f32, usize)> {
        let squared = |index: usize| {
            let off: [f32; 3] = std::array::from_fn(|a| self.points[index][a] - at[a]);
            let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
            let along = axis.map_or(0.0, |axis| dot(off, axis));
            dot(off, off) + (ALONG * ALONG - 1.0) * along * along
        };
        let mut near: Vec<(f32, usize)> = among
            .iter()
            .map(|index| (squared(*index), *index))
            .collect();
        let nearer = |(a, i): &(f32, usize), (b, j): &(f32, usize)| a.total_cmp(b).then(i.cmp(j));
        if near.len() > count {
            near.select_nth_unstable_by(count, nearer);
            near.truncate(count);
        }
        near.sort_unstable_by(nearer);
        near
    }

    /// The mean colour of points, by their nearness.
    fn mean(&self, near: &[(f32, usize)]) -> [f32; 3] {
        let weight = |squared: f32| 1.0 / (squared + NEAR * NEAR);
        let total: f32 = near.iter().map(|(squared, _)| weight(*squared)).sum();
        std::array::from_fn(|c| {
            let sum: f32 = (near.iter())
                .map(|(squared, index)| weight(*squared) * self.colours[*index][c])
                .sum();
            sum / total
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two arms along x, left (bone 1) and right (bone 2), of rings of four points; the bone of each point is given.
    fn arms(seen: impl Fn([f32; 3]) -> bool) -> Surface {
        let (mut points, mut colours, mut bones) = (Vec::new(), Vec::new(), Vec::new());
        for (bone, side) in [(1, 1.0f32), (2, -1.0)] {
            for step in 0..20 {
                for [y, z] in [[0.04, 0.0], [-0.04, 0.0], [0.0, 0.04], [0.0, -0.04]] {
                    points.push([side * (0.2 + 0.02 * step as f32), y, z]);
                    // Sleeves to half of the arm, in the colour of their side.
                    let sleeve = if step < 10 { 1.0 } else { 0.0 };
                    colours.push([sleeve, if bone == 1 { 0.5 } else { 0.7 }, 0.2]);
                    bones.push(bone);
                }
            }
        }
        Surface {
            seen: points.iter().map(|point| seen(*point)).collect(),
            shown: vec![true; points.len()],
            axes: vec![[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
            mirror: Some(Mirror {
                middle: 0.0,
                other: vec![0, 2, 1],
            }),
            points,
            colours,
            bones,
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
            (160, 80, 80)
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
        assert_eq!((guessed.mirrored, count(&guessed)), (0, 120));
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
        arms.shown[159] = false;
        let guessed = arms.guessed();
        let colours = guessed.colours.as_chunks::<3>().0;
        assert_eq!(colours[..80], arms.colours[..80]);
        assert_eq!(colours[159], arms.colours[159]);
        arms.seen.fill(false);
        let nothing = arms.guessed();
        assert_eq!(count(&nothing), 0);
    }
}
