//! Pixels of splats, and their Jacobian to the pose.
//!
//! A bone that rotates by ω about its joint at p carries the columns of its transform along: the last
//! one, its shift t, by ω × (t − p), the others by ω × column. A pixel's gradient to the transform of
//! a splat is a force on each column, of which each bone takes its share. What is left out: how the non-rigid field and pose blend
//! shapes change with the pose, and colours with the view.

use super::wrench::{self, Wrench};
use super::{Picture, PixelValues, PoseFitter};
use crate::avatar::{AvatarSplats, Posed};
use crate::render::RenderError;
use crate::render::splats::{HostSplats, body_view};
use rayon::prelude::*;
use tracing::trace_span;
use yoto_capture::camera::Pose;
use yoto_ops::splat::View;
use yoto_ops::splat::probe::Probe;
use yoto_ops::warp::inverse::solve::rigid_inverse;

impl PoseFitter<'_> {
    /// The values of the `pixels`, each by its `weights`, with their Jacobian to the pose; `None` if no splat is at any of them.
    pub(super) fn splat_pixels_with_jacobian(
        &self,
        splats: AvatarSplats<'_>,
        pose: &Pose,
        picture: &Picture,
        pixels: &[usize],
        weights: &[[f32; 4]],
    ) -> Result<Option<PixelValues>, RenderError> {
        let (posed, host) = self.posed(pose)?;
        let (host_splats, view) = self.host_splats(splats, pose, picture, &posed)?;
        let _span = trace_span!("fit: splats").entered();
        let probe = Probe::new(host_splats.as_slices(), &view);
        let asked = pixels.par_iter().zip(weights);
        let found: Vec<_> = asked
            .map(|(pixel, by)| probe.gradients(*pixel, *by))
            .collect();
        let transform_gradients = || found.iter().flat_map(|(_, gradients)| gradients);
        if transform_gradients().next().is_none() {
            return Ok(None);
        }
        let mut has_gradient = vec![false; probe.splats()];
        transform_gradients().for_each(|gradient| has_gradient[gradient.splat] = true);
        let indices = (0..probe.splats()).filter(|splat| has_gradient[*splat]);
        let with_gradient: Vec<usize> = indices.collect();
        let skinning = splats.skinning_weights_of(self.body, &posed, &with_gradient)?;
        let mut rank = vec![0; probe.splats()];
        for (i, splat) in with_gradient.iter().enumerate() {
            rank[*splat] = i;
        }
        let forward: Vec<[f32; 12]> = (host.transforms.as_chunks::<12>().0.iter())
            .map(rigid_inverse)
            .collect();
        let bones = host.joints.len();
        let mut wrenches = vec![Wrench::default(); pixels.len() * bones];
        let rows = wrenches.par_chunks_exact_mut(bones).zip(&found);
        rows.for_each(|(wrenches, (_, gradients))| {
            for gradient in gradients {
                for (bone, share) in skinning.of(rank[gradient.splat]) {
                    let bone = *bone as usize;
                    let carry = &forward[bone];
                    wrenches[bone].add(columns(carry, &gradient.to_transform, *share));
                }
            }
        });
        Ok(Some(PixelValues {
            values: found.iter().map(|(value, _)| *value).collect(),
            jacobian: wrench::jacobian(&self.body.skeleton, &host.joints, wrenches),
        }))
    }

    /// Red, green, blue and opacity of the `pixels`; `None` if no splat is at any of them.
    pub(super) fn splat_pixels(
        &self,
        splats: AvatarSplats<'_>,
        pose: &Pose,
        picture: &Picture,
        pixels: &[usize],
    ) -> Result<Option<Vec<[f32; 4]>>, RenderError> {
        let posed = (self.avatar).pose(
            self.config,
            self.body,
            self.slot,
            pose,
            self.schedule_progress,
        );
        let (splats, view) = self.host_splats(splats, pose, picture, &posed)?;
        let probe = Probe::new(splats.as_slices(), &view);
        let pixels = pixels.par_iter();
        let seen: Vec<[f32; 4]> = pixels.map(|pixel| probe.pixel(*pixel)).collect();
        let shown = seen.iter().any(|pixel| pixel[3] > 0.0);
        Ok(shown.then_some(seen))
    }

    /// The splats of the person in `pose`, and the camera of `picture` in their frame.
    fn host_splats(
        &self,
        splats: AvatarSplats<'_>,
        pose: &Pose,
        picture: &Picture,
        posed: &Posed,
    ) -> Result<(HostSplats<'static>, View), RenderError> {
        let view = body_view(&self.body.skeleton, pose, picture.camera);
        let splats = HostSplats::read(splats.posed_splats(self.body, posed)?, &view)?;
        Ok((splats, view))
    }
}

/// The wrench on a bone that takes the `share` of a gradient to a transform. Only the last column is a
/// position; shifts leave the others as they are.
fn columns(carry: &[f32; 12], to: &[f32; 12], share: f32) -> Wrench {
    let column = |t: &[f32; 12], c: usize| [t[c], t[4 + c], t[8 + c]].map(f64::from);
    let scaled = |c: usize| column(to, c).map(|v| f64::from(share) * v);
    let mut wrench = Wrench::at(column(carry, 3), scaled(3));
    for c in 0..3 {
        wrench.add(Wrench {
            force: [0.0; 3],
            ..Wrench::at(column(carry, c), scaled(c))
        });
    }
    wrench
}

#[cfg(test)]
#[path = "splats_tests.rs"]
mod tests;
