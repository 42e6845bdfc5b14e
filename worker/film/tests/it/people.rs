//! Two filmed people, as two models know them.

use std::sync::Arc;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::{Shard, ShardBuilder};
use yoto_film::{
    Bodies, Capture, CaptureNeed, Captures, ModelBodies, Person, Plan, PlanError, needs, plan,
};
use yoto_proto::v1::RenderSpec;
use yoto_synthetic::SyntheticPerson;

pub(crate) const ANN: &str = "subjects/ann";
pub(crate) const BEN: &str = "subjects/ben";
/// A model of fields.
pub(crate) const FIELDS: &str = "models/fields";
/// A model of splats.
pub(crate) const SPLATS: &str = "models/splats";
/// Frames of a capture.
pub(crate) const FRAMES: usize = 6;
/// Longest side of a capture's pictures, pixels.
pub(crate) const SIDE: u32 = 24;

/// The people of a test.
pub(crate) struct People {
    pub bodies: Bodies,
    shards: [(&'static str, Arc<Shard>); 2],
}

/// Both people in the model called `name`, in the slots 3 and 5.
fn model(name: &str, shards: &[(&str, Arc<Shard>)]) -> ModelBodies {
    let mut bodies = ModelBodies {
        name: name.into(),
        checkpoint: format!("{name}/checkpoints/9"),
        has_light: name == SPLATS,
        ..ModelBodies::default()
    };
    for ((subject, shard), slot) in shards.iter().zip([3, 5]) {
        let skeleton = Skeleton::from_track(&shard.track.skeleton).expect("a skeleton");
        bodies.skeletons.insert(slot, skeleton);
        bodies.people.push(Person {
            subject: (*subject).into(),
            display_name: subject.replace("subjects/", ""),
            slot,
        });
    }
    bodies
}

impl People {
    /// Ann and Ben in each of these models.
    pub(crate) fn of(models: &[&str]) -> Self {
        let cast = SyntheticPerson::cast(2, 7);
        let shard = |person: &SyntheticPerson| {
            let (track, images) = person.capture(FRAMES, SIDE);
            let mut builder = ShardBuilder::new(track);
            for image in &images {
                builder.push(image).expect("fits");
            }
            Arc::new(builder.finish().expect("complete"))
        };
        let shards = [(ANN, shard(&cast[0])), (BEN, shard(&cast[1]))];
        let models = models.iter().map(|name| model(name, &shards)).collect();
        Self {
            bodies: Bodies {
                models,
                unfilmed: Vec::new(),
            },
            shards,
        }
    }

    /// The capture of `subject`.
    pub(crate) fn shard(&self, subject: &str) -> &Arc<Shard> {
        let (_, shard) = self
            .shards
            .iter()
            .find(|(name, _)| *name == subject)
            .expect("was filmed");
        shard
    }

    /// The captures that a plan of `spec` needs, and whether their pictures.
    pub(crate) fn needs<'a>(&self, spec: &'a RenderSpec) -> Vec<(&'a str, bool)> {
        let needs = needs(spec, &self.bodies).into_iter();
        needs.map(|need| (need.subject, need.pictures)).collect()
    }

    /// The plan of `spec` from the captures that it needs, and no others.
    pub(crate) fn plan(&self, spec: &RenderSpec) -> Result<Plan, PlanError> {
        let mut captures = Captures::default();
        for CaptureNeed {
            model,
            subject,
            pictures,
        } in needs(spec, &self.bodies)
        {
            let shard = self.shard(subject);
            let capture = match pictures {
                true => Capture::Shard(Arc::clone(shard)),
                false => Capture::Track(shard.track.clone()),
            };
            captures.insert(model, subject, capture);
        }
        plan(spec, &self.bodies, &captures)
    }
}
