//! Sources of rest joints: a body model with shape parameters, or a file of rest joints.

use crate::body_model::BodyModel;
use crate::geometry::Vec3;
use crate::source::Source;
use crate::{ImportError, Options};
use std::path::Path;
use yoto_proto::pose_track::violation;
use yoto_proto::smpl::JOINTS;

/// Rest joints for shape parameters.
#[derive(Debug)]
pub(crate) enum RestJoints {
    /// From shape parameters.
    Model(BodyModel),
    /// Given: the same for all shapes.
    Given(Vec<Vec3>),
}

impl RestJoints {
    /// The source that the user gave; `None` without one.
    pub(crate) fn find(options: &Options) -> Result<Option<Self>, ImportError> {
        match (&options.rest_joints, &options.body_model) {
            (Some(path), _) => given(path).map(|joints| Some(Self::Given(joints))),
            (None, Some(path)) => BodyModel::open(path).map(|model| Some(Self::Model(model))),
            (None, None) => Ok(None),
        }
    }

    /// Finds rest joints as [`Self::find`] does, for formats whose files have only shape parameters.
    pub(crate) fn needed(
        options: &Options,
        source: &Source,
        file: &str,
    ) -> Result<Self, ImportError> {
        Self::find(options)?.ok_or_else(|| {
            let message = "rest joints of these shape parameters need your copy of SMPL's body \
                           model (--smpl FILE), or the joints themselves (--rest-joints FILE)";
            source.bad(vec![violation("MISSING", file, None, "betas", message)])
        })
    }

    /// Whether the shape parameters are SMPL-X's; `None` for given joints, which need no shape.
    pub(crate) fn is_smplx(&self) -> Option<bool> {
        match self {
            Self::Model(model) => Some(model.is_smplx()),
            Self::Given(_) => None,
        }
    }

    /// The 24 rest joints, metres.
    pub(crate) fn joints(&self, betas: &[f64]) -> Vec<Vec3> {
        match self {
            Self::Model(model) => model.joints(betas),
            Self::Given(joints) => joints.clone(),
        }
    }
}

/// Joints of JSON (a list, `{"joints": …}`, or a capture's `poses.json`) or of a pickle such as
/// HumanNeRF's `canonical_joints.pkl`.
fn given(path: &Path) -> Result<Vec<Vec3>, ImportError> {
    let source = Source::new(path.parent().unwrap_or(Path::new("")));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let data = source.data(&name, None)?;
    let root = data.root();
    let skeleton = root.find("skeleton");
    let part = match (&skeleton, root.find("joints")) {
        (Some(skeleton), _) => skeleton.get("rest_joints")?,
        (None, Some(joints)) => joints,
        (None, None) => root,
    };
    let joints = part.rows::<3>()?;
    if joints.len() == JOINTS.len() {
        return Ok(joints);
    }
    let message = format!("{} joints, {} are needed", joints.len(), JOINTS.len());
    Err(part.fault("SIZE_MISMATCH", message))
}
