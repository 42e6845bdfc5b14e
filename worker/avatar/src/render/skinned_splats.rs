//! One person of a model of splats, for players and files: splats in the rest pose, and the
//! bones that carry them.

use super::frame::{RenderError, Renderer};
use super::levels::{LevelSplat, groups, merged};
use crate::avatar::AvatarAppearance;
use crate::field::pose_shapes::{HostShapes, Limits, Nearness, mixed};
use crate::host::read;
use std::borrow::Cow;
use std::collections::BTreeMap;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::joints_of_body;
use yoto_ops::splat::light::LIGHTS;
use yoto_ops::splat::{SplatRow, harmonics, means_of_rows, splat_rows};

/// Most bones that carry a splat: players have room for as many.
pub(super) const BONES: usize = 4;

/// A person of a model of splats, in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinnedSplats {
    /// Joint tree with rest positions.
    pub skeleton: Skeleton,
    /// The splats that can be seen.
    pub splats: Vec<SkinnedSplat>,
    /// Degree of the harmonics by which colours depend on the view.
    pub degree: usize,
    /// Offsets of splats by poses, on top of their bones.
    pub shapes: Option<SkinnedShapes>,
    /// Light of each colour channel: a colour is multiplied by 1 + Σ lᵢ bᵢ(n) ([`yoto_ops::splat::light`]).
    pub light: [[f32; LIGHTS]; 3],
}

/// Pose blend shapes: before its bones carry it, a splat at x moves by Σᵣ hᵣ Σₖ aₖ(x) Bᵣₖ φ(Ωₖ). φ(Ωₖ) = R(Ωₖ) − I of the
/// joint k, row-major, within limits about the range that was filmed, and 0 for the root; aₖ(x) = exp(−d²/2r²) of the distance d of x to
/// the joint and the bones to its children, in the rest pose. Joints of fingers are not among the K.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinnedShapes {
    /// R.
    pub count: usize,
    /// r, metres.
    pub reach: f32,
    /// B `[K, 9, 3, R]`, metres.
    pub basis: Vec<f32>,
    /// `[2, 9 K]`: the least and the greatest values with which features take part.
    pub limits: Vec<f32>,
    /// h `[N, R]`, of the splats in their order.
    pub weights: Vec<f32>,
}

/// A Gaussian on the body's surface in the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinnedSplat {
    /// Metres.
    pub mean: [f32; 3],
    /// Unit quaternion, real part first. The third axis is the surface's normal.
    pub rotation: [f32; 4],
    /// Standard deviations along the rotated axes, metres.
    pub deviations: [f32; 3],
    /// 0 to 1, at the centre.
    pub opacity: f32,
    /// Without light.
    pub colour: [f32; 3],
    /// View-dependent part of the colour, in the rest pose ([`yoto_ops::splat::harmonics`]); zeros above
    /// [`SkinnedSplats::degree`].
    pub harmonics: [[f32; 3]; harmonics::HARMONICS],
    /// Joints whose bones carry it, most first, and their shares, which sum to 1.
    pub bones: [(u16, f32); BONES],
    /// Whether no frame of the person's capture shows it: its colour is guessed.
    pub guessed: bool,
}

impl Renderer {
    /// The splats of the identity in `slot`, with the non-rigid offsets of the rest pose; `None` if the
    /// model has a field.
    ///
    /// # Errors
    /// If the slot is empty, or the model can't be read from its device.
    pub fn skinned_splats(&self, slot: usize) -> Result<Option<SkinnedSplats>, RenderError> {
        let skeleton = self.skeleton(slot).ok_or(RenderError::NoSuchSlot(slot))?;
        let rest = Pose::rest(skeleton.joints());
        let body = self.body_in(slot, &rest)?;
        let posed = self
            .avatar
            .pose(&self.config, body, slot, &rest, self.schedule_progress);
        let avatar = match self.avatar.appearance(&self.config) {
            AvatarAppearance::Splats(splats) => splats,
            AvatarAppearance::Field(_) => return Ok(None),
        };
        let splats = avatar.posed_splats(body, &posed)?;
        let skinning = avatar.skinning_weights(body, &posed)?;
        let rows = read(splats.rows())?;
        let shapes = avatar.host_shapes(body, &posed, &means_of_rows(&rows))?;
        let sh_coefficients = splats.harmonics.map(read).transpose()?.unwrap_or_default();
        let light = read(splats.light)?;
        let flags = avatar.frozen_colours(slot)?;
        let all = splat_rows(&rows);
        let numbers = sh_coefficients.len() / all.len().max(1);
        let splats = all.enumerate().map(|(i, row)| {
            let own = sh_coefficients[i * numbers..][..numbers].as_chunks::<3>().0;
            SkinnedSplat {
                guessed: flags.as_ref().is_some_and(|flags| flags[i]),
                ..skinned(row, own, skinning.of(i))
            }
        });
        let splats: Vec<(usize, SkinnedSplat)> = splats
            .enumerate()
            .filter(|(_, splat)| splat.is_visible())
            .collect();
        Ok(Some(SkinnedSplats {
            skeleton: skeleton.clone(),
            degree: harmonics::degree(numbers / 3),
            shapes: shapes.map(|it| {
                let own = |(i, _): &(usize, SkinnedSplat)| &it.weights[i * it.count..][..it.count];
                SkinnedShapes {
                    count: it.count,
                    reach: it.reach,
                    limits: it.limits().to_vec(),
                    weights: splats.iter().flat_map(own).copied().collect(),
                    basis: it.basis,
                }
            }),
            splats: splats.into_iter().map(|(_, splat)| splat).collect(),
            light: std::array::from_fn(|channel| {
                std::array::from_fn(|term| light[channel * LIGHTS + term])
            }),
        }))
    }
}

impl SkinnedSplats {
    /// The splats as pose blend shapes move them in `pose`, before bones carry them.
    pub fn shaped(&self, pose: &Pose) -> Cow<'_, [SkinnedSplat]> {
        let Some(shapes) = &self.shapes else {
            return Cow::Borrowed(&self.splats);
        };
        let mut places: Vec<[f32; 3]> = self.splats.iter().map(|splat| splat.mean).collect();
        let known = joints_of_body(&self.skeleton);
        let near = Nearness::new(&self.skeleton, &self.skeleton.rest[..known], shapes.reach);
        let limits = Limits::of(shapes.limits.clone());
        let (basis, weights) = (shapes.basis.clone(), shapes.weights.clone());
        let shapes = HostShapes::new(&near, basis, limits, weights, places.as_flattened());
        shapes.add(&mut places, pose);
        let moved = self.splats.iter().zip(places);
        let splats = moved.map(|(splat, mean)| SkinnedSplat { mean, ..*splat });
        splats.collect()
    }

    /// The same person with at most `count` splats: near ones of the same part of the body become one.
    #[must_use]
    pub fn reduced_to(&self, count: usize) -> Self {
        let all: Vec<LevelSplat> = self.splats.iter().map(SkinnedSplat::level).collect();
        let mut splats = Vec::with_capacity(count);
        let mut weights = Vec::new();
        for group in groups(&all, count) {
            let (splat, shares) = self.merged(&all, &group);
            splats.push(splat);
            if let Some(shapes) = &self.shapes {
                let members = group.into_iter().zip(shares);
                weights.extend(mixed(&shapes.weights, shapes.count, members));
            }
        }
        Self {
            splats,
            shapes: self
                .shapes
                .clone()
                .map(|shapes| SkinnedShapes { weights, ..shapes }),
            ..self.clone()
        }
    }

    /// The splat in place of a `group`, and the share of each member in it.
    fn merged(&self, all: &[LevelSplat], group: &[usize]) -> (SkinnedSplat, Vec<f32>) {
        let (level, weights) = merged(all, group);
        if let [only] = group {
            return (self.splats[*only], weights);
        }
        let mut harmonics = [[0.0; 3]; harmonics::HARMONICS];
        let mut shares: BTreeMap<u16, f32> = BTreeMap::new();
        let mut guessed = 0.0;
        for (weight, at) in weights.iter().zip(group) {
            let splat = &self.splats[*at];
            guessed += if splat.guessed { *weight } else { 0.0 };
            let terms = splat.harmonics.as_flattened().iter();
            for (sum, term) in harmonics.as_flattened_mut().iter_mut().zip(terms) {
                *sum += weight * term;
            }
            for (bone, share) in splat.bones {
                *shares.entry(bone).or_default() += weight * share;
            }
        }
        let shares = shares.into_iter().filter(|(_, share)| *share > 0.0);
        let shares = shares.map(|(bone, share)| (usize::from(bone), share));
        let splat = SkinnedSplat {
            guessed: guessed > 0.5,
            ..SkinnedSplat::of_level(&level, harmonics, most(shares.collect()))
        };
        (splat, weights)
    }
}

impl SkinnedSplat {
    fn of_level(
        level: &LevelSplat,
        harmonics: [[f32; 3]; harmonics::HARMONICS],
        bones: [(u16, f32); BONES],
    ) -> Self {
        Self {
            mean: level.mean,
            rotation: level.rotation,
            deviations: level.deviations,
            opacity: level.opacity,
            colour: level.colour,
            harmonics,
            bones,
            guessed: false,
        }
    }

    fn level(&self) -> LevelSplat {
        LevelSplat {
            mean: self.mean,
            rotation: self.rotation,
            deviations: self.deviations,
            opacity: self.opacity,
            colour: self.colour,
            bone: self.bones[0].0,
        }
    }

    /// Whether the renderer draws it at all.
    fn is_visible(&self) -> bool {
        let mut harmonics = self.harmonics.as_flattened().iter();
        self.level().is_visible() && harmonics.all(|number| number.is_finite())
    }
}

/// The splat of a row, with its harmonics and the bones that carry it.
fn skinned(row: SplatRow, own: &[[f32; 3]], skinning: &[(u32, f32)]) -> SkinnedSplat {
    let shares = skinning
        .iter()
        .map(|(bone, share)| (*bone as usize, *share));
    let bones = most(shares.collect());
    let level = LevelSplat::of_row(&row, bones[0].0);
    let harmonics = std::array::from_fn(|k| own.get(k).copied().unwrap_or_default());
    SkinnedSplat::of_level(&level, harmonics, bones)
}

/// The [`BONES`] largest of `shares`, which sum to 1 again.
fn most(mut shares: Vec<(usize, f32)>) -> [(u16, f32); BONES] {
    shares.sort_by(|(_, one), (_, other)| other.total_cmp(one));
    shares.truncate(BONES);
    let sum: f32 = shares.iter().map(|(_, share)| share).sum();
    std::array::from_fn(|index| match shares.get(index) {
        // A skeleton has at most 256 joints.
        Some((bone, share)) => (*bone as u16, share / sum),
        None => (0, 0.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bones_with_most_weight_carry_a_splat_alone() {
        let shares = vec![(7, 0.1), (2, 0.4), (5, 0.05), (3, 0.2), (9, 0.15), (1, 0.1)];
        let kept = most(shares);
        assert_eq!(kept.map(|(bone, _)| bone), [2, 3, 9, 7]);
        assert!((kept.iter().map(|(_, share)| share).sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((kept[0].1 - 0.4 / 0.85).abs() < 1e-6);
        assert_eq!(
            most(vec![(6, 1.0)]),
            [(6, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]
        );
    }
}
