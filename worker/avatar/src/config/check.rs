//! Validation of configurations.

use super::{
    Appearance, ConfigError, LayersConfig, LearnExposure, ModelConfig, MotionForm, Numerics,
    Precision, Variant,
};
use burn::tensor::Device;
use yoto_ops::mlp::supports;

/// Checks that networks can run in `precision` on `device`.
///
/// # Errors
/// If they cannot.
pub(crate) fn check_precision(precision: Precision, device: &Device) -> Result<(), ConfigError> {
    match supports(precision, device) {
        true => Ok(()),
        false => Err(ConfigError::Field {
            field: "precision",
            message: "bf16 runs on the CPU only; this device needs f32".into(),
        }),
    }
}

impl ModelConfig {
    /// Checks that a model of this configuration can run on `device`.
    ///
    /// # Errors
    /// Names the first field that the device does not support.
    pub(crate) fn check_device(&self, device: &Device) -> Result<(), ConfigError> {
        check_precision(self.precision, device)
    }

    /// The device that pictures of this model are rendered on, of those that a machine has: `device`, or
    /// the CPU for splats, whose pictures are drawn in host memory.
    ///
    /// # Errors
    /// Names the first field that the device does not support.
    pub(crate) fn render_device(&self, device: &Device) -> Result<Device, ConfigError> {
        let device = match self.appearance {
            Appearance::Splats(_) => Device::flex(),
            Appearance::Field(_) => device.clone(),
        };
        self.check_device(&device)?;
        Ok(device)
    }

    /// Checks all fields.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        let nodes = self.motion.resolution.nodes();
        if nodes.iter().any(|count| !(2..=256).contains(count)) {
            return fail("motion.resolution", "must be 2 to 256 along each axis");
        }
        let own = self.motion.own().nodes();
        if own
            .iter()
            .zip(nodes)
            .any(|(own, all)| !(2..=all).contains(own))
        {
            return fail(
                "motion.own",
                "must be 2 to motion.resolution along each axis",
            );
        }
        if let MotionForm::Deconv {
            embedding,
            hidden,
            channels,
        } = &self.motion.form
        {
            let doubled = 1usize.checked_shl(channels.len() as u32 + 1);
            if doubled.is_none_or(|side| nodes != [side; 3])
                || *embedding == 0
                || *hidden == 0
                || channels.contains(&0)
            {
                return fail(
                    "motion.form",
                    "widths at least 1, and motion.resolution 2 to the number of channels plus one along each axis",
                );
            }
        }
        if !(1..=4096).contains(&self.code_width) {
            return fail("code_width", "must be 1 to 4096");
        }
        self.non_rigid.layers.check("non_rigid.layers")?;
        let has_codes = matches!(self.variant, Variant::Yoto | Variant::NoPoseCondition);
        if has_codes && self.non_rigid.layers.inject == 0 {
            return fail(
                "non_rigid.layers.inject",
                "must not be 0: the first layer receives the pose",
            );
        }
        if self.optimise.patches == 0 || self.optimise.patch_size == 0 {
            return fail("optimise", "at least one patch of one pixel");
        }
        let mask = self.optimise.mask_weight;
        if !(mask.is_finite() && mask >= 0.0) {
            return fail("optimise.mask_weight", "must be at least 0");
        }
        let share = self.optimise.backward_share;
        if !(share > 0.0 && share <= 1.0) {
            return fail("optimise.backward_share", "must be above 0 and at most 1");
        }
        match &self.appearance {
            Appearance::Field(field) => {
                field.check()?;
                if self.exposure.who != LearnExposure::Never {
                    return fail(
                        "exposure.who",
                        "must be never without splats: only their tier learns exposures",
                    );
                }
            }
            Appearance::Splats(splats) => {
                splats.check()?;
                if !(0.0..=1.0).contains(&self.optimise.ssim_weight) {
                    return fail("optimise.ssim_weight", "must be 0 to 1 for splats");
                }
                if self.numerics == Numerics::Reference {
                    return fail("numerics", "must be sound for splats");
                }
            }
        }
        self.refinement.check()?;
        self.exposure.check()?;
        self.schedule.check()
    }
}

impl LayersConfig {
    /// Checks the layers, which the configuration calls `field`.
    pub(super) fn check(&self, field: &'static str) -> Result<(), ConfigError> {
        if self.width == 0
            || self.depth == 0
            || self.inject >= self.depth
            || self.skip.is_some_and(|s| s == 0 || s >= self.depth)
        {
            return Err(ConfigError::Field {
                field,
                message: "width and depth at least 1, inject and skip name a layer, and skip not the first"
                    .into(),
            });
        }
        Ok(())
    }
}
