//! The splats of one person: Gaussians on the body's surface in the canonical pose, and the light of the
//! person's capture.

use crate::host::{ReadError, read};
use crate::identity::stored_names::stored;
use crate::init::Initial;
use burn::module::{Module, Param, ParamId};
use burn::tensor::{Tensor, activation};
use yoto_ops::splat::harmonics;
use yoto_ops::splat::light::LIGHTS;

/// Parameters of one person's splats, with the meaning that [`yoto_ops::splat::Splats`] gives them.
#[derive(Module, Debug)]
pub struct Splats {
    /// `[N, 3]`.
    pub means: Param<Tensor<2>>,
    /// `[N, 4]`: quaternions wxyz, of any length but 0.
    pub rotations: Param<Tensor<2>>,
    /// `[N, 3]`.
    pub scales: Param<Tensor<2>>,
    /// `[N]`.
    pub opacities: Param<Tensor<1>>,
    /// `[N, 3]`.
    pub colours: Param<Tensor<2>>,
    /// `[N]`, 1 where a colour is guessed and does not learn, else 0; late in a run and after it, and never trained itself.
    pub frozen: Option<Param<Tensor<1>>>,
    /// `[N, 3 K]`, where colours depend on the view.
    pub harmonics: Option<Param<Tensor<2>>>,
    /// `[3, 8]`.
    pub light: Param<Tensor<2>>,
    /// `[N, 4]`: indices of the bones that carry each splat, where splats lie on a body's surface; never trained.
    pub bones: Option<Param<Tensor<2>>>,
    /// `[N, 4]`: the weights of these bones on the surface, which sum to 1; never trained themselves: the volume of motion
    /// weights changes them by factors.
    pub bone_weights: Option<Param<Tensor<2>>>,
}

/// Bones that carry a splat.
pub(crate) const BONES: usize = 4;

/// Values of splats in host memory, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SplatValues {
    /// `[N, 3]`, metres.
    pub means: Vec<f32>,
    /// `[N, 4]`: quaternions wxyz, of any length but 0.
    pub rotations: Vec<f32>,
    /// `[N, 3]`.
    pub scales: Vec<f32>,
    /// `[N]`, logits.
    pub opacities: Vec<f32>,
    /// `[N, 3]`.
    pub colours: Vec<f32>,
    /// Where splats lie on a body's surface.
    pub skinning: Option<SurfaceSkinning>,
}

/// The bones that carry splats, by the surface they lie on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SurfaceSkinning {
    /// `[N, 4]`, indices.
    pub bones: Vec<f32>,
    /// `[N, 4]`, which sum to 1.
    pub weights: Vec<f32>,
}

/// Opacity from which a splat tells what the surface looks like.
pub(crate) const SOLID: f32 = 0.3;

/// Opacity times area, m², of a splat that lies flat, by its deviations, metres.
pub fn opaque_area(opacity: f32, mut deviations: [f32; 3]) -> f32 {
    deviations.sort_unstable_by(f32::total_cmp);
    opacity * deviations[1] * deviations[2]
}

/// Logit of the opacity of splats that are not drawn.
pub(crate) const HIDDEN: f32 = -20.0;

impl SplatValues {
    /// These values, and hidden splats behind them: `count` in all.
    pub(crate) fn padded_to(mut self, count: usize) -> Self {
        let hidden = Self::at_origin(count - self.opacities.len());
        self.means.extend(hidden.means);
        self.rotations.extend(hidden.rotations);
        self.scales.extend(hidden.scales);
        self.opacities.resize(count, HIDDEN);
        self.colours.extend(hidden.colours);
        if let Some(skinning) = &mut self.skinning {
            skinning.bones.resize(BONES * count, 0.0);
            // Hidden splats follow the root, so that their weights sum to 1 too.
            let missing = count - skinning.weights.len() / BONES;
            skinning
                .weights
                .extend([1.0, 0.0, 0.0, 0.0].repeat(missing));
        }
        self
    }

    /// `count` splats at the origin: placeholders before a person is known.
    pub(crate) fn at_origin(count: usize) -> Self {
        Self {
            means: vec![0.0; 3 * count],
            rotations: [1.0, 0.0, 0.0, 0.0].repeat(count),
            scales: vec![-5.0; 3 * count],
            opacities: vec![0.0; count],
            colours: vec![0.5; 3 * count],
            skinning: None,
        }
    }
}

/// The name of the harmonics has their degree, since an optimiser keeps moments by name, and those of another degree do
/// not fit.
fn harmonics_path(slot: usize, degree: usize) -> String {
    format!("splats.{slot}.harmonics.{degree}")
}

/// Name in checkpoints of the flags of frozen colours; those late in a run and of finished models have them.
pub(crate) fn frozen_path(slot: usize) -> String {
    stored(&format!("splats.{slot}.frozen"))
}

/// Names in checkpoints of the bones of splats on a surface, and of their weights.
pub(crate) fn skinning_paths(slot: usize) -> [String; 2] {
    ["bones", "bone_weights"].map(|name| stored(&format!("splats.{slot}.{name}")))
}

impl Splats {
    /// Whether they have bones and weights of a body's surface.
    pub(crate) fn has_surface(&self) -> bool {
        self.bones.is_some()
    }

    /// Makes room for bones and weights of a body's surface.
    pub(crate) fn expect_surface(&mut self, init: &Initial, slot: usize) {
        let [count, _] = self.means.val().dims();
        let [bones, weights] = skinning_paths(slot);
        self.bones = Some(init.zeros(&bones, [count, BONES]));
        self.bone_weights = Some(init.zeros(&weights, [count, BONES]));
    }

    /// Whether each splat on a surface has bones of a skeleton with `joints` joints, and weights that sum to 1.
    pub(crate) fn has_good_bones(&self, joints: usize) -> Result<bool, ReadError> {
        let (Some(bones), Some(weights)) = (&self.bones, &self.bone_weights) else {
            return Ok(true);
        };
        let (bones, weights) = (read(bones.val().detach())?, read(weights.val().detach())?);
        let is_joint = |bone: &f32| bone.fract() == 0.0 && (0.0..joints as f32).contains(bone);
        let is_mean = |own: &[f32]| {
            let sum: f32 = own.iter().sum();
            own.iter().all(|weight| *weight >= 0.0) && (sum - 1.0).abs() < 1e-3
        };
        Ok(bones.iter().all(is_joint) && weights.chunks_exact(BONES).all(is_mean))
    }

    /// Whether none is hidden.
    pub(crate) fn shows_all(&self) -> Result<bool, ReadError> {
        let opacities = read(self.opacities.val().detach())?;
        // Hidden ones never learn, so that they keep theirs exactly.
        Ok(opacities.iter().all(|logit| *logit != HIDDEN))
    }

    /// Multiplies the opacities by `share`, above 0 and at most 1.
    pub(crate) fn fade(&mut self, share: f32) {
        let opacity = activation::sigmoid(self.opacities.val()) * share;
        // Of an opacity of 1 there is no logit in f32.
        let clear = (-opacity.clone() + 1.0).clamp_min(f32::EPSILON);
        let logit = (opacity / clear).log();
        self.opacities = Param::initialized(ParamId::new(), logit);
    }

    /// The colours `[N, 3]`, of which those that are frozen have no gradient.
    pub(crate) fn learning_colours(&self) -> Tensor<2> {
        let colours = self.colours.val();
        let Some(frozen) = &self.frozen else {
            return colours;
        };
        let frozen = frozen.val().detach().unsqueeze_dim::<2>(1);
        // Exact: each factor is 0 or 1.
        colours.clone() * (-frozen.clone() + 1.0) + colours.detach() * frozen
    }

    /// Freezes the colours of the splats that `frozen` `[N]` names; with `None`, all learn.
    pub(crate) fn freeze_colours(&mut self, init: &Initial, slot: usize, frozen: Option<&[bool]>) {
        self.frozen = frozen.map(|frozen| {
            let flags: Vec<f32> = frozen.iter().map(|it| f32::from(u8::from(*it))).collect();
            init.given(&frozen_path(slot), [flags.len()], &flags)
        });
    }

    /// Degree of the harmonics by which colours depend on the view.
    pub(crate) fn degree(&self) -> usize {
        let harmonics = self.harmonics.as_ref();
        harmonics.map_or(0, |it| harmonics::degree(it.val().dims()[1] / 3))
    }

    /// Replaces the colours `[N, 3]`. Those that are `anew` `[N]` no longer depend on the view.
    pub(crate) fn paint(
        &mut self,
        init: &Initial,
        slot: usize,
        colours: &[f32],
        anew: &[bool],
    ) -> Result<(), ReadError> {
        let path = format!("splats.{slot}.colours");
        self.colours = init.given(&path, [colours.len() / 3, 3], colours);
        if let Some(harmonics) = &self.harmonics {
            let shape = harmonics.val().dims();
            let path = harmonics_path(slot, self.degree());
            let mut numbers = read(harmonics.val().detach())?;
            for (own, _) in (numbers.chunks_exact_mut(shape[1]).zip(anew)).filter(|it| *it.1) {
                own.fill(0.0);
            }
            self.harmonics = Some(init.given(&path, shape, &numbers));
        }
        Ok(())
    }

    /// Lets colours depend on the view by harmonics of up to `degree`, with the coefficients that are known of them.
    pub(crate) fn reach(
        &mut self,
        init: &Initial,
        slot: usize,
        degree: usize,
    ) -> Result<(), ReadError> {
        let before = self.degree();
        if degree == before {
            return Ok(());
        }
        let known = match self.harmonics.take() {
            Some(harmonics) => read(harmonics.val().detach())?,
            None => Vec::new(),
        };
        let [old, new] = [before, degree].map(|degree| 3 * harmonics::count(degree));
        let [count, _] = self.means.val().dims();
        let mut numbers = vec![0.0; count * new];
        let both = old.min(new);
        if both > 0 {
            let rows = numbers.chunks_exact_mut(new).zip(known.chunks_exact(old));
            rows.for_each(|(row, known)| row[..both].copy_from_slice(&known[..both]));
        }
        let path = harmonics_path(slot, degree);
        self.harmonics = (degree > 0).then(|| init.given(&path, [count, new], &numbers));
        Ok(())
    }

    /// The present values of all splats, hidden ones too.
    pub(crate) fn values(&self) -> Result<SplatValues, ReadError> {
        Ok(SplatValues {
            means: read(self.means.val().detach())?,
            rotations: read(self.rotations.val().detach())?,
            scales: read(self.scales.val().detach())?,
            opacities: read(self.opacities.val().detach())?,
            colours: read(self.colours.val().detach())?,
            skinning: match (&self.bones, &self.bone_weights) {
                (Some(bones), Some(weights)) => Some(SurfaceSkinning {
                    bones: read(bones.val().detach())?,
                    weights: read(weights.val().detach())?,
                }),
                _ => None,
            },
        })
    }

    /// Replaces the values of all splats. Splat i has the view-dependent colour of the splat `from[i]`; the light
    /// and the moments of the optimiser stay.
    pub(crate) fn replace(
        &mut self,
        init: &Initial,
        slot: usize,
        values: &SplatValues,
        from: &[usize],
    ) -> Result<(), ReadError> {
        let degree = self.degree();
        let harmonics = match &self.harmonics {
            Some(harmonics) => {
                let shape = harmonics.val().dims();
                let before = read(harmonics.val().detach())?;
                let row = |index: &usize| &before[index * shape[1]..(index + 1) * shape[1]];
                let numbers: Vec<f32> = from.iter().flat_map(row).copied().collect();
                Some(init.given(&harmonics_path(slot, degree), shape, &numbers))
            }
            None => None,
        };
        let light = self.light.clone();
        *self = Self {
            light,
            harmonics,
            ..Self::new(init, slot, values, 0)
        };
        Ok(())
    }

    /// The splats of the person in `slot`, without light; their colours will depend on the view by harmonics of up to
    /// `degree`.
    pub(crate) fn new(init: &Initial, slot: usize, first: &SplatValues, degree: usize) -> Self {
        let count = first.means.len() / 3;
        let path = |name: &str| stored(&format!("splats.{slot}.{name}"));
        let skinning = first.skinning.as_ref();
        let given = |name: &str, values: &[f32]| init.given(&path(name), [count, BONES], values);
        Self {
            bones: skinning.map(|it| given("bones", &it.bones)),
            bone_weights: skinning.map(|it| given("bone_weights", &it.weights)),
            means: init.given(&path("means"), [count, 3], &first.means),
            rotations: init.given(&path("rotations"), [count, 4], &first.rotations),
            scales: init.given(&path("scales"), [count, 3], &first.scales),
            opacities: init.given(&path("opacities"), [count], &first.opacities),
            colours: init.given(&path("colours"), [count, 3], &first.colours),
            frozen: None,
            harmonics: (degree > 0).then(|| {
                let numbers = 3 * harmonics::count(degree);
                init.zeros(&harmonics_path(slot, degree), [count, numbers])
            }),
            light: init.zeros(&path("light"), [3, LIGHTS]),
        }
    }
}
