//! What a person of splats keeps from pose to pose: the splats in the rest pose, and the bones that carry each.
//! A frame then only moves bones.

use super::frame::{RenderError, Renderer};
use crate::avatar::AvatarSplats;
use crate::host::read;
use crate::motion::body::Body;
use std::borrow::Cow;
use yoto_capture::camera::Pose;
use yoto_ops::splat::View;
use yoto_ops::splat::harmonics::add_view_colours;
use yoto_ops::warp::skin::weights::SkinningWeights;

/// A person's splats in host memory, in no pose.
pub(super) struct Carried {
    /// `[N, 14]`: mean, rotation, scales, opacity and colour.
    rows: Vec<f32>,
    /// `[N, K, 3]`, of colours that depend on the view.
    harmonics: Option<Vec<f32>>,
    /// `[3, 8]`.
    pub light: Vec<f32>,
    shares: SkinningWeights,
}

impl Carried {
    /// The rows with the colours that a camera sees of splats with these `transforms` `[N, 12]`.
    pub fn rows_seen_from(&self, sight: &View, transforms: &[f32]) -> Cow<'_, [f32]> {
        let mut rows = Cow::Borrowed(self.rows.as_slice());
        if let Some(harmonics) = &self.harmonics {
            add_view_colours(rows.to_mut(), harmonics, transforms, sight);
        }
        rows
    }

    /// Canonical to posed `[N, 12]` of each splat, from the bones' `transforms` `[K, 12]`.
    pub fn posed(&self, transforms: &[f32]) -> Vec<f32> {
        self.shares.skin(transforms)
    }
}

impl Renderer {
    /// What the identity in `slot` keeps; looked up at the first frame. `None` where splats move with the pose
    /// on top of their bones.
    ///
    /// # Errors
    /// If the model can't be read from its device.
    pub(super) fn carried(
        &self,
        splats: AvatarSplats<'_>,
        slot: usize,
        body: &Body,
    ) -> Result<Option<&Carried>, RenderError> {
        let moves = self.config.schedule.moves_points(self.progress);
        let (false, Some(kept)) = (moves, self.kept.get(slot)) else {
            return Ok(None);
        };
        if let Some(carried) = kept.get() {
            return Ok(Some(carried));
        }
        let rest = Pose::rest(body.skeleton.joints());
        let posed = (self.avatar).pose(&self.config, body, slot, &rest, self.progress);
        let splats = splats.posed(body, &posed);
        let (rows, weights) = (read(splats.rows().detach())?, read(posed.weights.detach())?);
        let means = read(splats.means.detach())?;
        let harmonics = splats.harmonics.map(|it| read(it.detach()));
        let bones = body.skeleton.joints();
        let carried = Carried {
            shares: SkinningWeights::new(&weights, bones, &means, &body.grid),
            light: read(splats.light.detach())?,
            harmonics: harmonics.transpose()?,
            rows,
        };
        // Another thread may have been faster, with the same.
        Ok(Some(kept.get_or_init(|| carried)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::{Avatar, AvatarAppearance};
    use crate::config::ModelConfig;
    use crate::field::splats::FirstSplats;
    use crate::render::splats::{HostSplats, sight};
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
        let placed = FirstSplats {
            means,
            ..FirstSplats::of_nobody(joints)
        };
        avatar.place_splats(0, &placed);
        let shine = avatar.splats[0].harmonics.as_ref().expect("degree 2").val();
        let shine = shine.random_like(Distribution::Normal(0.0, 0.1));
        avatar.splats[0].harmonics = Some(Param::from_tensor(shine));
        let body = Body::new(skeleton, &config, &device);
        let renderer = Renderer::new(config, avatar, vec![Some(body)], vec![None], 1.0);
        let mut seen: Vec<Vec<f32>> = Vec::new();
        let AvatarAppearance::Splats(avatar) = renderer.avatar.appearance(&renderer.config) else {
            panic!("the tier has splats");
        };
        for pose in person.unseen_motion(3) {
            let body = renderer.body_in(0, &pose).expect("a body");
            let carried = renderer.carried(avatar, 0, body).expect("read");
            let carried = carried.expect("nothing but bones moves splats of this tier");
            let posed = (renderer.avatar).pose(&renderer.config, body, 0, &pose, 1.0);
            let bones = read(posed.transforms.clone()).expect("read");
            let splats = avatar.posed(body, &posed);
            let camera = Camera::look_at(
                [0.5, 1.2, 3.0],
                [0.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                80.0,
                64,
                64,
            );
            let sight = sight(&body.skeleton, &pose, &camera);
            let found = carried.posed(&bones);
            let rows = carried.rows_seen_from(&sight, &found);
            let host = HostSplats::read(splats.clone(), &sight).expect("read");
            for (row, wanted) in rows.iter().zip(host.numbers().rows) {
                assert!((row - wanted).abs() < 1e-5, "{row}, not {wanted}");
            }
            let unlike = (rows.iter().zip(&carried.rows)).filter(|(a, b)| a != b);
            assert_eq!(
                unlike.count(),
                3 * joints,
                "the colours change with the view"
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
