//! Splats of two people on the way from one to the other. The splats of two people do not correspond, but their places on the
//! body do ([`crate::decoder::parts`]): each splat moves as far out or in as the other person's body is wider or narrower
//! there, and its colour changes by the difference of both people's mean colours there. So the splats of both
//! have the same outline and the same colours, but for what is finer than a cell, which fades from one to the other.

use super::frame::{RenderError, Renderer};
use crate::avatar::AvatarAppearance;
use crate::decoder::cells::Means;
use crate::decoder::parts::{BodyPlace, Parts};
use crate::field::splats::{SOLID, SplatValues, opaque_area};
use yoto_capture::camera::Pose;

/// A person's colours and widths by places on the body.
struct Looks {
    values: SplatValues,
    /// Place of each splat, its distance from the middle line of its part, metres, and the unit vector from there.
    places: Vec<(BodyPlace, f32, [f32; 3])>,
    colours: Means,
    /// Distances from the middle line, metres, thrice.
    widths: Means,
}

impl Renderer {
    /// Moves the splats in the slots `first` and `second` to where both are the same: the share `1 − share` of the way
    /// from `second` to `first`. Nothing changes for people without SMPL's joints.
    pub(super) fn morph(
        &mut self,
        [first, second]: [usize; 2],
        share: f32,
    ) -> Result<(), RenderError> {
        let (Some(one), Some(other)) = (self.looks(first)?, self.looks(second)?) else {
            return Ok(());
        };
        for (slot, own, to, part) in [
            (first, &one, &other, share),
            (second, &other, &one, 1.0 - share),
        ] {
            let values = own.towards(to, part);
            let all: Vec<usize> = (0..values.opacities.len()).collect();
            self.avatar.replace_splats(slot, &values, &all)?;
        }
        Ok(())
    }

    /// The looks of the person in `slot`; `None` without splats or SMPL's joints.
    fn looks(&self, slot: usize) -> Result<Option<Looks>, RenderError> {
        let rest = Pose::rest(self.skeleton(slot).map_or(0, |it| it.joints()));
        let body = self.body_in(slot, &rest)?;
        let splats = match self.avatar.appearance(&self.config) {
            AvatarAppearance::Splats(splats) => splats,
            AvatarAppearance::Field(_) => return Ok(None),
        };
        let Some(parts) = Parts::of(&body.skeleton) else {
            return Ok(None);
        };
        let posed = splats.pose(body, slot, &rest, self.schedule_progress);
        let skinning = splats.skinning_weights(body, &posed)?;
        let values = splats.values(slot)?;
        let places: Vec<(BodyPlace, f32, [f32; 3])> = (values.means.as_chunks::<3>().0.iter())
            .enumerate()
            .map(|(i, at)| {
                let joint = usize::from(skinning.largest(i));
                let (width, out) = parts.across(*at, joint);
                (parts.place(*at, joint), width, out)
            })
            .collect();
        let weight = |index: usize| {
            let opacity = 1.0 / (1.0 + (-values.opacities[index]).exp());
            let deviations = std::array::from_fn(|a| values.scales[3 * index + a].exp());
            match opacity > SOLID {
                true => opaque_area(opacity, deviations),
                false => 0.0,
            }
        };
        let of = |number: &dyn Fn(usize) -> [f32; 3]| {
            let all = 0..places.len();
            Means::of(all.map(|index| (places[index].0, number(index), weight(index))))
        };
        let colours = of(&|index| std::array::from_fn(|c| values.colours[3 * index + c]));
        let widths = of(&|index| [places[index].1; 3]);
        Ok(Some(Looks {
            places,
            colours,
            widths,
            values,
        }))
    }
}

impl Looks {
    /// These splats, the `share` of the way to what the `other` person looks like.
    fn towards(&self, other: &Self, share: f32) -> SplatValues {
        let mut values = self.values.clone();
        for (index, (place, _, out)) in self.places.iter().enumerate() {
            let change = |own: &Means, other: &Means| -> [f32; 3] {
                match (own.at(*place), other.at(*place)) {
                    (Some(own), Some(other)) => {
                        std::array::from_fn(|c| share * (other[c] - own[c]))
                    }
                    _ => [0.0; 3],
                }
            };
            let colour = change(&self.colours, &other.colours);
            let [wider, ..] = change(&self.widths, &other.widths);
            for c in 0..3 {
                values.colours[3 * index + c] += colour[c];
                values.means[3 * index + c] += wider * out[c];
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk of points all around a vertical line at the origin, `width` metres from it.
    fn trunk(width: f32, colour: [f32; 3]) -> Looks {
        let mut values = SplatValues::at_origin(0);
        let mut places = Vec::new();
        for index in 0..2400 {
            let (along, around) = ((index / 48) as f32 / 50.0, (index % 48) as f32 / 48.0);
            let (sin, cos) = (around * std::f32::consts::TAU).sin_cos();
            let out = [sin, 0.0, cos];
            values.means.extend([width * sin, along, width * cos]);
            values.rotations.extend([1.0, 0.0, 0.0, 0.0]);
            values.scales.extend([-4.0; 3]);
            values.opacities.push(4.0);
            values.colours.extend(colour);
            let place = BodyPlace {
                part: 0,
                along,
                around,
            };
            places.push((place, width, out));
        }
        let all = || places.iter().map(|(place, ..)| *place);
        Looks {
            colours: Means::of(all().map(|place| (place, colour, 1.0))),
            widths: Means::of(all().map(|place| (place, [width; 3], 1.0))),
            places,
            values,
        }
    }

    #[test]
    fn half_way_both_are_as_wide_and_have_the_same_colours() {
        let (slim, broad) = (trunk(0.1, [1.0, 0.0, 0.0]), trunk(0.2, [0.0, 0.0, 1.0]));
        let halves = [slim.towards(&broad, 0.5), broad.towards(&slim, 0.5)];
        for half in &halves {
            for (mean, colour) in half
                .means
                .as_chunks::<3>()
                .0
                .iter()
                .zip(half.colours.as_chunks::<3>().0)
            {
                assert!((mean[0].hypot(mean[2]) - 0.15).abs() < 1e-3, "{mean:?}");
                assert!((colour[0] - 0.5).abs() < 1e-3 && (colour[2] - 0.5).abs() < 1e-3);
            }
        }
        let near = slim.towards(&broad, 0.25);
        assert!((near.means[0].hypot(near.means[2]) - 0.125).abs() < 1e-3);
    }

    #[test]
    fn where_the_other_has_nothing_a_person_stays() {
        let slim = trunk(0.1, [1.0, 0.0, 0.0]);
        let mut bare = trunk(0.2, [0.0; 3]);
        bare.colours = Means::of(std::iter::empty());
        bare.widths = Means::of(std::iter::empty());
        assert_eq!(slim.towards(&bare, 0.5), slim.values);
    }
}
