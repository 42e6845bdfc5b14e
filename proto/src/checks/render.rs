//! Orders to render.

use super::scene::MAX_PICTURES;
use super::{SpecFault, SpecFaults, scene};
use crate::render_needs::{model_of, other_models};
use crate::tiers;
use crate::v1::render_quality::Want;
use crate::v1::render_spec::What;
use crate::v1::{Between, Layer, RenderQuality, RenderSpec, Scene};
use std::ops::RangeInclusive;

/// Frame rates of an animation, per second; 0 leaves it to the worker.
const RATES: RangeInclusive<f32> = 0.0..=120.0;
/// Mixtures of two people in one render.
const MIXTURES: RangeInclusive<usize> = 1..=100;

/// All faults of an order to render.
pub fn faults(render: &RenderSpec) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    check_background(&mut found, render);
    found.between("fps", render.fps, &RATES);
    if let Some(quality) = &render.quality {
        check_quality(&mut found, quality);
    }
    check_layer(&mut found, render);
    if let Some(light) = &render.light {
        found.light("light", light);
    }
    if let Some(between) = &render.between {
        check_between(&mut found, render, between);
    }
    if !render.bones.is_empty() {
        let alone = !matches!(render.what, Some(What::Scene(_))) && !render.compare;
        found.unless(alone && render.between.is_none(), "bones", || {
            "not in scenes, not between two people, and nobody has filmed them to compare with"
                .into()
        });
    }
    match &render.what {
        Some(what) => check_pictures(&mut found, render, what),
        None => found.add("what", "views, an orbit, a motion or a scene is needed"),
    }
    found.0
}

fn check_pictures(found: &mut SpecFaults, render: &RenderSpec, what: &What) {
    match what {
        What::Views(list) => {
            found.count("views.views", list.views.len());
            for (i, view) in list.views.iter().enumerate() {
                found.view(&format!("views.views[{i}]"), view);
            }
        }
        What::Orbit(orbit) => {
            found.count("orbit.views", orbit.views as usize);
            found.side("orbit.size", orbit.size);
        }
        What::Clip(clip) => {
            found.count("clip.poses", clip.poses.len());
            found.side("clip.size", clip.size);
            found.motion("clip", clip);
        }
        What::Motion(motion) => {
            // 0 means all remaining frames; the worker knows their number and limits it. With an end, this is
            // only an upper limit.
            if motion.frame_count > 0 && motion.end_frame.is_none() {
                found.count("motion.frame_count", motion.frame_count as usize);
            }
            found.end_frame("motion", motion.first_frame, motion.end_frame);
            found.unless(motion.frame_step > 0, "motion.frame_step", || {
                "a step of 0 never reaches the next frame".into()
            });
            found.side("motion.size", motion.size);
        }
        What::Scene(scene) => {
            found.unless(render.light.is_none(), "light", || {
                "the actors of a scene have their own".into()
            });
            found.unless(render.subject.is_empty(), "subject", || {
                "a scene has actors instead".into()
            });
            found.within_field("scene", scene::faults(scene));
            check_models(found, render, scene);
        }
    }
}

/// Number of pictures of one person in `what`, limited to [`MAX_PICTURES`]; 0 if it depends on a capture.
fn known_pictures(what: &What) -> u64 {
    let count = match what {
        What::Views(list) => list.views.len() as u64,
        What::Orbit(orbit) => orbit.views.into(),
        What::Clip(clip) => clip.poses.len() as u64,
        // With an end, the count is only an upper limit.
        What::Motion(motion) if motion.end_frame.is_none() => motion.frame_count.into(),
        What::Motion(_) | What::Scene(_) => 0,
    };
    count.min(MAX_PICTURES.into())
}

/// The fault of a render with too many pictures, `pictures` for each of `people`; `None` if the number is allowed.
pub fn too_many(pictures: u64, people: u64) -> Option<String> {
    let all = pictures.saturating_mul(people);
    (all > u64::from(MAX_PICTURES)).then(|| match people {
        1 => format!("{all} pictures: at most {MAX_PICTURES} are allowed"),
        _ => format!(
            "{pictures} pictures of {people} people are {all}: at most {MAX_PICTURES} are allowed"
        ),
    })
}

/// Checks the models of a scene: at least one actor must use the render's.
fn check_models(found: &mut SpecFaults, render: &RenderSpec, scene: &Scene) {
    let mut models = scene.actors.iter().map(|actor| model_of(render, actor));
    let own = scene.actors.is_empty() || models.any(|model| model == render.model);
    found.unless(own, "scene.actors", || {
        format!(
            "no actor belongs to {}: render the scene with the model of an actor",
            render.model
        )
    });
    let measured = render.quality.as_ref().is_some_and(tiers::needs_tradeoff);
    let several = !other_models(render).is_empty();
    found.unless(!measured || !several, "quality", || {
        "people of several models have no trade-off that was measured together: leave the goal out, \
         and each model has its own settings"
            .into()
    });
}

fn check_between(found: &mut SpecFaults, render: &RenderSpec, between: &Between) {
    let shares = between.shares.len();
    let (least, most) = (MIXTURES.start(), MIXTURES.end());
    found.unless(MIXTURES.contains(&shares), "between.shares", || {
        format!("{shares} mixtures: {least} to {most} are allowed")
    });
    for (i, share) in between.shares.iter().enumerate() {
        found.between(&format!("between.shares[{i}]"), *share, &(0.0..=1.0));
    }
    let pictures = render.what.as_ref().map_or(0, known_pictures);
    if let Some(message) = too_many(pictures, shares as u64) {
        found.add("between.shares", message);
    }
    let alone = !matches!(render.what, Some(What::Scene(_))) && !render.compare;
    found.unless(alone, "between", || {
        "not in scenes, and nobody has filmed them to compare with".into()
    });
}

fn check_background(found: &mut SpecFaults, render: &RenderSpec) {
    let colour = &render.background;
    let in_unit = |value: &f32| (0.0..=1.0).contains(value);
    let good = matches!(colour.len(), 0 | 3) && colour.iter().all(in_unit);
    found.unless(good, "background", || {
        format!("{colour:?}: nothing, or three numbers from 0 to 1")
    });
    let black = colour.iter().all(|value| *value == 0.0);
    found.unless(!good || !render.transparent || black, "background", || {
        format!("{colour:?}: a transparent picture has none")
    });
}

/// Checks the ranges of the goal for each frame.
fn check_quality(found: &mut SpecFaults, quality: &RenderQuality) {
    let mut above_zero = |name: &str, value: f64| {
        let field = format!("quality.{name}");
        found.unless(value.is_finite() && value > 0.0, &field, || {
            format!("{value} is not a number above 0")
        });
    };
    match &quality.want {
        Some(Want::MaxSecondsPerFrame(value)) => above_zero("max_seconds_per_frame", *value),
        Some(Want::MinPsnrDb(value)) => above_zero("min_psnr_db", *value),
        Some(Want::Tier(tier)) => {
            found.unless(tiers::is_render_tier(tier), "quality.tier", || {
                let shown: String = tier.chars().take(80).collect();
                let known = tiers::render_tiers();
                format!("there is no render quality '{shown}'; qualities: {known}")
            });
        }
        None => found.add("quality", "has no goal"),
    }
}

/// What the pictures show.
fn check_layer(found: &mut SpecFaults, render: &RenderSpec) {
    let layer = Layer::try_from(render.layer);
    found.unless(layer.is_ok(), "layer", || {
        format!("{} is not known", render.layer)
    });
    let layered = !matches!(layer, Ok(Layer::Unspecified));
    let scene = match &render.what {
        Some(What::Scene(scene)) => Some(scene),
        _ => None,
    };
    let surrounded = scene.is_some_and(|scene| scene.shadow || !scene.backdrop.is_empty());
    let coloured = render.background.iter().any(|value| *value != 0.0);
    for (wrong, field, message) in [
        (
            layered && (render.transparent || surrounded || coloured),
            "layer",
            "depth and opacity have no background, transparency or shadow",
        ),
        (
            layered && render.compare,
            "compare",
            "only colours were filmed",
        ),
        (
            render.transparent && render.compare,
            "compare",
            "filmed pictures are not transparent",
        ),
        (
            render.transparent && scene.is_some_and(|scene| !scene.backdrop.is_empty()),
            "scene.backdrop",
            "a transparent picture has none",
        ),
    ] {
        found.unless(!wrong, field, || message.into());
    }
}

#[cfg(test)]
mod tests;
