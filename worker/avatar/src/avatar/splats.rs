//! Reading and changing the splats of one identity from outside of the optimiser.

use super::Avatar;
use crate::field::splats::{SplatValues, Splats};
use crate::host::ReadError;
use crate::init::Initial;
use yoto_capture::camera::Pose;

impl Avatar {
    /// Whether no splat of the identity in `slot` is hidden ([`SplatValues::padded_to`]).
    pub(crate) fn shows_all_splats(&self, slot: usize) -> Result<bool, ReadError> {
        match self.splats.get(slot) {
            Some(splats) => splats.shows_all(),
            None => Ok(true),
        }
    }

    /// Changes the splats of the identity in `slot`, if the model has splats.
    pub(super) fn change_splats(
        &mut self,
        slot: usize,
        change: impl FnOnce(&Initial<'_>, &mut Splats) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        let device = self.device();
        // Nothing is drawn, so any seed will do.
        let init = Initial::new(&device, 0);
        match self.splats.get_mut(slot) {
            Some(splats) => change(&init, splats),
            None => Ok(()),
        }
    }

    /// Widens the range of poses of the identity in `slot` to the `poses` of a capture.
    pub(crate) fn record_pose_range<'a>(
        &mut self,
        slot: usize,
        poses: impl Iterator<Item = &'a Pose>,
    ) -> Result<(), ReadError> {
        let device = self.device();
        // Nothing is drawn, so any seed will do.
        let init = Initial::new(&device, 0);
        match &mut self.pose_shapes {
            Some(shapes) => shapes.record_pose_range(&init, slot, poses),
            None => Ok(()),
        }
    }

    /// Replaces the splats and the light of the identity in `slot` by those at the start of a
    /// training.
    pub(crate) fn place_splats(&mut self, slot: usize, first: &SplatValues) {
        let device = self.device();
        // Nothing is drawn, so any seed will do.
        let init = Initial::new(&device, 0);
        if let Some(splats) = self.splats.get_mut(slot) {
            *splats = Splats::new(&init, slot, first, splats.degree());
        }
    }

    /// The values of the splats of the identity in `slot`; none if the model has no splats.
    pub(crate) fn splat_values(&self, slot: usize) -> Result<SplatValues, ReadError> {
        match self.splats.get(slot) {
            Some(splats) => splats.values(),
            None => Ok(SplatValues::at_origin(0)),
        }
    }

    /// Replaces the values of the splats of the identity in `slot`, whose light stays. Splat i has the
    /// view-dependent colour of the splat `from[i]`.
    pub(crate) fn replace_splats(
        &mut self,
        slot: usize,
        values: &SplatValues,
        from: &[usize],
    ) -> Result<(), ReadError> {
        self.change_splats(slot, |init, splats| {
            splats.replace(init, slot, values, from)
        })
    }

    /// Replaces the `colours` `[N, 3]` of the splats of the identity in `slot`. Those that are `anew` `[N]` no longer
    /// depend on the view.
    pub(crate) fn paint_splats(
        &mut self,
        slot: usize,
        colours: &[f32],
        anew: &[bool],
    ) -> Result<(), ReadError> {
        self.change_splats(slot, |init, splats| splats.paint(init, slot, colours, anew))
    }

    /// Makes room for the bones of the splats of the identity in `slot`, which lie on a body's surface.
    pub(crate) fn expect_surface(&mut self, slot: usize) {
        let device = self.device();
        // Nothing is drawn, so any seed will do.
        let init = Initial::new(&device, 0);
        if let Some(splats) = self.splats.get_mut(slot) {
            splats.expect_surface(&init, slot);
        }
    }

    /// Lets the colours of all splats depend on the view by harmonics of up to `degree`.
    pub(crate) fn set_harmonics_degree(&mut self, degree: usize) -> Result<(), ReadError> {
        let device = self.device();
        // Nothing is drawn, so any seed will do.
        let init = Initial::new(&device, 0);
        for (slot, splats) in self.splats.iter_mut().enumerate() {
            splats.reach(&init, slot, degree)?;
        }
        Ok(())
    }
}
