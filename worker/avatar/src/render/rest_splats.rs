//! The parts of a person of splats that poses do not change: the splats in the rest pose, and the bones that carry each.
//! A frame then only moves bones.

use super::frame::{RenderError, Renderer};
use super::levels::{LevelSplat, count, groups, merged};
use crate::avatar::AvatarSplats;
use crate::field::pose_shapes::HostShapes;
use crate::host::read;
use crate::motion::body::CanonicalBody;
use std::borrow::Cow;
use std::sync::OnceLock;
use yoto_capture::camera::Pose;
use yoto_ops::splat::harmonics::add_view_colours;
use yoto_ops::splat::{ROW, SplatRow, View, means_of_rows, splat_rows};
use yoto_ops::warp::skin::weights::SkinningWeights;

/// Most levels that are kept at once, including that of all splats.
const LEVELS: usize = 8;

/// The splats of people in the rest pose, by level of detail.
pub(super) struct RestSplatsCache {
    /// Share of the splats, and the cached splats by slot. The first level has all splats.
    levels: Vec<(f32, Vec<OnceLock<RestSplats>>)>,
    /// Index of the present level.
    chosen: usize,
    slots: usize,
}

impl RestSplatsCache {
    /// An empty cache for people in `slots` slots; frames have all splats.
    pub(super) fn new(slots: usize) -> Self {
        Self {
            levels: vec![(1.0, empty(slots))],
            chosen: 0,
            slots,
        }
    }

    pub(super) fn add_slot(&mut self) {
        self.slots += 1;
        let levels = self.levels.iter_mut();
        levels.for_each(|(_, slots)| slots.push(OnceLock::new()));
    }

    /// Frames have this `share` of the splats from now on. Of more than [`LEVELS`] levels the oldest goes, but never that
    /// of all splats.
    pub(super) fn choose(&mut self, share: f32) {
        let known = self.levels.iter().position(|(known, _)| *known == share);
        self.chosen = known.unwrap_or_else(|| {
            if self.levels.len() == LEVELS {
                self.levels.remove(1);
            }
            self.levels.push((share, empty(self.slots)));
            self.levels.len() - 1
        });
    }

    /// The share, and what the person in `slot` keeps at it.
    fn of(&self, slot: usize) -> Option<(f32, &OnceLock<RestSplats>)> {
        let (share, slots) = &self.levels[self.chosen];
        Some((*share, slots.get(slot)?))
    }
}

fn empty(slots: usize) -> Vec<OnceLock<RestSplats>> {
    (0..slots).map(|_| OnceLock::new()).collect()
}

/// A person's splats in host memory, in no pose.
pub(super) struct RestSplats {
    /// `[N, 14]`: mean, rotation, scales, opacity and colour.
    rows: Vec<f32>,
    /// `[N, K, 3]`, of colours that depend on the view.
    harmonics: Option<Vec<f32>>,
    /// `[3, 8]`.
    pub light: Vec<f32>,
    shares: SkinningWeights,
    shapes: Option<HostShapes>,
}

impl RestSplats {
    /// The rows in `pose`, with the colours that a camera sees of splats with these `transforms` `[N, 12]`.
    pub(super) fn rows_for_view(
        &self,
        body_view: &View,
        pose: &Pose,
        transforms: &[f32],
    ) -> Cow<'_, [f32]> {
        let mut rows = Cow::Borrowed(self.rows.as_slice());
        if let Some(shapes) = &self.shapes {
            shapes.add(rows.to_mut().as_chunks_mut::<ROW>().0, pose);
        }
        if let Some(harmonics) = &self.harmonics {
            add_view_colours(rows.to_mut(), harmonics, transforms, body_view);
        }
        rows
    }

    /// Canonical to posed `[N, 12]` of each splat, from the bones' `transforms` `[K, 12]`.
    pub(super) fn skin(&self, transforms: &[f32]) -> Vec<f32> {
        self.shares.skin(transforms)
    }
}

impl Renderer {
    /// The rest splats of the identity in `slot`, which the first frame computes. `None` where the non-rigid field
    /// moves splats.
    ///
    /// # Errors
    /// If the model can't be read from its device.
    pub(super) fn rest_splats(
        &self,
        avatar: AvatarSplats<'_>,
        slot: usize,
        body: &CanonicalBody,
    ) -> Result<Option<&RestSplats>, RenderError> {
        let moves = self.config.schedule.moves_points(self.schedule_progress);
        let (false, Some((share, kept))) = (moves, self.rest_splats_cache.of(slot)) else {
            return Ok(None);
        };
        if let Some(rest) = kept.get() {
            return Ok(Some(rest));
        }
        let rest = Pose::rest(body.skeleton.joints());
        let posed = (self.avatar).pose(&self.config, body, slot, &rest, self.schedule_progress);
        let splats = avatar.posed_splats(body, &posed)?;
        let mut rows = read(splats.rows().detach())?;
        // Nothing moves in the rest pose, so that the rows have the canonical places.
        let mut shapes = avatar.host_shapes(body, &posed, &means_of_rows(&rows))?;
        let harmonics = splats.harmonics.map(|it| read(it.detach()));
        let mut harmonics = harmonics.transpose()?;
        let mut own = avatar.skinning_weights(body, &posed)?;
        if share < 1.0 {
            let level = level(&rows, harmonics.as_deref(), &own, share);
            (rows, harmonics) = (level.rows, level.harmonics);
            own = own.merged(&level.groups);
            shapes = shapes.map(|it| it.merged(&level.groups, body, &means_of_rows(&rows)));
        }
        let rest = RestSplats {
            shares: own,
            shapes,
            light: read(splats.light.detach())?,
            harmonics,
            rows,
        };
        // Another thread may have been faster, with the same.
        Ok(Some(kept.get_or_init(|| rest)))
    }
}

/// Fewer splats.
struct Level {
    rows: Vec<f32>,
    harmonics: Option<Vec<f32>>,
    /// The splats that each splat replaces, with their weights in it.
    groups: Vec<Vec<(usize, f32)>>,
}

/// Fewer splats in place of those that can be seen.
fn level(rows: &[f32], harmonics: Option<&[f32]>, shares: &SkinningWeights, share: f32) -> Level {
    let rows: Vec<SplatRow> = splat_rows(rows).collect();
    let numbers = harmonics.map_or(0, |it| it.len() / rows.len().max(1));
    let own = |index: usize| &harmonics.unwrap_or_default()[numbers * index..][..numbers];
    let (mut seen, mut splats) = (Vec::new(), Vec::new());
    for (index, row) in rows.iter().enumerate() {
        let splat = LevelSplat::of_row(row, shares.largest(index));
        if splat.is_visible() && own(index).iter().all(|v| v.is_finite()) {
            seen.push(index);
            splats.push(splat);
        }
    }
    let groups = groups(&splats, count(splats.len(), share));
    let mut fewer = Vec::with_capacity(ROW * groups.len());
    let mut mixed = Vec::with_capacity(numbers * groups.len());
    let mut replaced = Vec::with_capacity(groups.len());
    for group in groups {
        let (splat, weights) = merged(&splats, &group);
        match *group.as_slice() {
            [only] => fewer.extend(<[f32; ROW]>::from(rows[seen[only]])),
            _ => fewer.extend(<[f32; ROW]>::from(splat.to_row())),
        }
        mixed.extend((0..numbers).map(|k| {
            let members = weights.iter().zip(&group);
            let terms = members.map(|(weight, at)| weight * own(seen[*at])[k]);
            terms.sum::<f32>()
        }));
        let members = group.iter().zip(&weights);
        replaced.push(members.map(|(at, weight)| (seen[*at], *weight)).collect());
    }
    Level {
        rows: fewer,
        harmonics: harmonics.map(|_| mixed),
        groups: replaced,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::{Avatar, AvatarAppearance};
    use crate::config::ModelConfig;
    use crate::field::splats::SplatValues;
    use crate::render::splats::{HostSplats, body_view};
    use burn::module::Param;
    use burn::tensor::{Device, Distribution};
    use yoto_capture::camera::Camera;
    use yoto_capture::skeleton::Skeleton;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn splats_go_with_the_bones_of_every_pose() {
        let device = Device::flex();
        let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
        config.appearance.splats_mut().expect("splats").harmonics = 2;
        let person = &SyntheticPerson::cast(1, 7)[0];
        let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
        let near = |[x, y, z]: &[f64; 3]| [*x as f32 + 0.02, *y as f32 - 0.03, *z as f32];
        let means: Vec<f32> = skeleton.rest.iter().flat_map(near).collect();
        let joints = skeleton.joints();
        let mut avatar = Avatar::new(&config, 1, joints, 5, &device);
        let placed = SplatValues {
            means,
            ..SplatValues::at_origin(joints)
        };
        avatar.place_splats(0, &placed);
        let sh_coefficients = avatar.splats[0].harmonics.as_ref().expect("degree 2").val();
        let sh_coefficients = sh_coefficients.random_like(Distribution::Normal(0.0, 0.1));
        avatar.splats[0].harmonics = Some(Param::from_tensor(sh_coefficients));
        let poses = person.unseen_motion(3);
        avatar.record_pose_range(0, poses.iter()).expect("read");
        let shapes = avatar.pose_shapes.as_mut().expect("the tier has some");
        shapes.basis = Param::from_tensor(
            shapes
                .basis
                .val()
                .random_like(Distribution::Normal(0.0, 0.05)),
        );
        let body = CanonicalBody::new(skeleton, &config, &device);
        let renderer = Renderer::new(config, avatar, vec![Some(body)], vec![None], 1.0);
        let mut seen: Vec<Vec<f32>> = Vec::new();
        let AvatarAppearance::Splats(avatar) = renderer.avatar.appearance(&renderer.config) else {
            panic!("the tier has splats");
        };
        for pose in poses {
            let body = renderer.body_in(0, &pose).expect("a body");
            let rest = renderer.rest_splats(avatar, 0, body).expect("read");
            let rest = rest.expect("nothing but bones moves splats of this tier");
            let posed = (renderer.avatar).pose(&renderer.config, body, 0, &pose, 1.0);
            let bones = read(posed.transforms.clone()).expect("read");
            let splats = avatar.posed_splats(body, &posed).expect("read");
            let camera = Camera::look_at(
                [0.5, 1.2, 3.0],
                [0.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                80.0,
                64,
                64,
            );
            let body_view = body_view(&body.skeleton, &pose, &camera);
            let found = rest.skin(&bones);
            let rows = rest.rows_for_view(&body_view, &pose, &found);
            let host = HostSplats::read(splats.clone(), &body_view).expect("read");
            for (row, wanted) in rows.iter().zip(host.as_slices().rows) {
                assert!((row - wanted).abs() < 1e-5, "{row}, not {wanted}");
            }
            let unlike = (rows.iter().zip(&rest.rows)).filter(|(a, b)| a != b);
            assert_eq!(
                unlike.count(),
                6 * joints,
                "colours change with the view, and places with the pose"
            );
            let wanted = read(splats.transforms).expect("read");
            assert_eq!(found.len(), wanted.len());
            for (found, wanted) in found.iter().zip(&wanted) {
                assert!((found - wanted).abs() < 1e-5, "{found}, not {wanted}");
            }
            seen.push(found);
        }
        assert_ne!(seen[0], seen[2], "the person moves");
    }
}
