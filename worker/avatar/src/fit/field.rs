//! Pixels of a field, and their Jacobian to the pose.

use super::{HostPose, Picture, PixelValues, PoseFitter, jacobian};
use crate::avatar::{AvatarField, Posed};
use crate::host::read;
use crate::render::RenderError;
use crate::render::composite::composite;
use crate::render::march::{Volume, march};
use crate::render::samples::Samples;
use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use tracing::trace_span;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::Pose;

impl PoseFitter<'_> {
    /// The values of the `pixels`, each by its `weights`, with their Jacobian to the pose; `None` if no sample is live.
    pub(super) fn field_pixels_with_jacobian(
        &self,
        field: AvatarField<'_>,
        pose: &Pose,
        picture: &Picture,
        pixels: &[usize],
        weights: &[[f32; 4]],
    ) -> Result<Option<PixelValues>, RenderError> {
        let (posed, host) = self.posed(pose)?;
        let samples = trace_span!("fit: march")
            .in_scope(|| self.samples(field, pose, picture, pixels, &host));
        if samples.live() == 0 {
            return Ok(None);
        }
        let (values, to_warped) = trace_span!("fit: gradients")
            .in_scope(|| self.gradients(field, &posed, &samples, weights))?;
        let unposing = self.config.motion.unposing;
        let jacobian = trace_span!("fit: joints")
            .in_scope(|| jacobian::rays(self.body, &host, unposing, &samples, to_warped));
        Ok(Some(PixelValues { values, jacobian }))
    }

    /// Red, green, blue and opacity of the `pixels`; `None` if no sample is live.
    pub(super) fn field_pixels(
        &self,
        field: AvatarField<'_>,
        pose: &Pose,
        picture: &Picture,
        pixels: &[usize],
    ) -> Result<Option<Vec<[f32; 4]>>, RenderError> {
        let (posed, host) = self.posed(pose)?;
        let samples = self.samples(field, pose, picture, pixels, &host);
        if samples.live() == 0 {
            return Ok(None);
        }
        let (points, likelihood) = self.warped(&samples);
        let seen = read(self.seen(field, &posed, &samples, points, likelihood))?;
        Ok(Some(seen.as_chunks::<4>().0.to_vec()))
    }

    /// The live samples of the rays through `pixels`.
    pub(super) fn samples(
        &self,
        field: AvatarField<'_>,
        pose: &Pose,
        picture: &Picture,
        pixels: &[usize],
        host: &HostPose,
    ) -> Samples {
        let view = BodyView::new(&self.body.skeleton, pose, picture.camera);
        let width = picture.image.width;
        let rays: Vec<_> = (pixels.iter())
            .map(|p| view.ray((p % width) as f64 + 0.5, (p / width) as f64 + 0.5))
            .collect();
        let volume = Volume {
            weights: &host.weights,
            transforms: &host.transforms,
            grid: &self.body.grid,
            unposing: self.config.motion.unposing,
            occupancy: self.occupancy,
            step: None,
        };
        march(&rays, &field.config.march, None::<&mut ChaCha8Rng>, &volume).all()
    }

    /// The canonical points `[n, 3]` and the likelihoods `[n]` of `samples`.
    fn warped(&self, samples: &Samples) -> (Tensor<2>, Tensor<1>) {
        let n = samples.live();
        let points = TensorData::new(samples.canonical.clone(), [n, 3]);
        let likelihood = TensorData::new(samples.likelihoods.clone(), [n]);
        (
            Tensor::from_data(points, self.device),
            Tensor::from_data(likelihood, self.device),
        )
    }

    /// Red, green, blue and opacity of the rays of `samples`, `[R, 4]`.
    fn seen(
        &self,
        field: AvatarField<'_>,
        posed: &Posed,
        samples: &Samples,
        points: Tensor<2>,
        likelihood: Tensor<1>,
    ) -> Tensor<2> {
        let values = field.values(self.body, posed, points);
        let seen = composite(
            samples,
            field.config.march.min_transmittance,
            None,
            values.rgb,
            values.density,
            likelihood,
        );
        Tensor::cat(vec![seen.rgb, seen.alpha.unsqueeze_dim::<2>(1)], 1)
    }

    /// The values of the rays of `samples`, by the `weights` of red, green, blue and opacity of each:
    /// `[R]`, and its gradients `[n, 4]` to the samples' canonical points and likelihoods.
    pub(super) fn gradients(
        &self,
        field: AvatarField<'_>,
        posed: &Posed,
        samples: &Samples,
        weights: &[[f32; 4]],
    ) -> Result<(Vec<f32>, Vec<f32>), RenderError> {
        let n = samples.live();
        let (points, likelihood) = self.warped(samples);
        let (points, likelihood) = (points.require_grad(), likelihood.require_grad());
        let seen = self.seen(field, posed, samples, points.clone(), likelihood.clone());
        let weights = TensorData::new(weights.concat(), [weights.len(), 4]);
        let weights = Tensor::<2>::from_data(weights, self.device);
        let seen = (seen * weights).sum_dim(1);
        let shown = read(seen.clone().detach())?;
        let grads = seen.sum().backward();
        let none = |width: usize| vec![0.0; n * width];
        let to_points = points.grad(&grads).map_or_else(|| Ok(none(3)), read)?;
        let to_likelihood = likelihood.grad(&grads).map_or_else(|| Ok(none(1)), read)?;
        let (to_points, _) = to_points.as_chunks::<3>();
        let to_warped = (to_points.iter().zip(to_likelihood))
            .flat_map(|([x, y, z], likelihood)| [*x, *y, *z, likelihood])
            .collect();
        Ok((shown, to_warped))
    }
}
