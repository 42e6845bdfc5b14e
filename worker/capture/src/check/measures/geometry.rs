//! Measures of the agreement of cameras, poses and masks on the body's position.

use super::super::agreement::Agreement;
use super::super::report::{Cause, Grade, Measure, MeasureKind};
use super::super::timing::Shifts;
use super::grading::{measure, share};

pub(super) fn reading_of(cause: Option<&Cause>) -> Measure {
    let Some(cause) = cause else {
        let meaning = "no other reading of poses and cameras fits the masks decisively better";
        return measure(
            MeasureKind::Reading,
            Grade::Pass,
            Some(0.0),
            "as given".to_owned(),
            meaning,
        );
    };
    let gain = cause.fit_mended - cause.fit;
    let shown = format!("+{:.0} % overlap", 100.0 * gain);
    let meaning = "the numbers mean something else than they should";
    Measure {
        cause: Some(cause.sentence()),
        ..measure(
            MeasureKind::Reading,
            Grade::Fail,
            Some(gain),
            shown,
            meaning,
        )
    }
}

pub(super) fn timing_of(cause: Option<&Cause>, bodies: &Shifts, images: &Shifts) -> Measure {
    let shift = if bodies.best == 0 {
        images.best
    } else {
        bodies.best
    };
    let Some(cause) = cause else {
        let meaning = "masks and poses are of the same frames, as far as outlines tell";
        return measure(
            MeasureKind::Timing,
            Grade::Pass,
            Some(0.0),
            "0 frames".to_owned(),
            meaning,
        );
    };
    let shown = format!("{shift:+} frames");
    let meaning = "outlines of another moment blur moving limbs away";
    Measure {
        cause: Some(cause.sentence()),
        ..measure(
            MeasureKind::Timing,
            Grade::Fail,
            Some(f64::from(shift)),
            shown,
            meaning,
        )
    }
}

pub(super) fn body_size(span: f64) -> Measure {
    let grade = if (0.6..=2.6).contains(&span) {
        Grade::Pass
    } else if (0.25..=4.0).contains(&span) {
        Grade::Warn
    } else {
        Grade::Fail
    };
    let meaning = "span of the rest joints; margins and priors are in metres";
    let cause = (grade != Grade::Pass).then(|| {
        "rest joints are not in metres, or not of a person in a T-pose (`--units` reads others)"
            .to_owned()
    });
    Measure {
        cause,
        ..measure(
            MeasureKind::BodySize,
            grade,
            Some(span),
            format!("{span:.2} m"),
            meaning,
        )
    }
}

pub(super) fn joints(agreement: &Agreement) -> Measure {
    let meaning = "joints outside are learnt as empty space";
    let mut it = share(
        MeasureKind::JointsInMask,
        agreement.joints_in_mask,
        [0.9, 0.6],
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("poses or cameras are of another person, video or time".to_owned());
        it.frames.clone_from(&agreement.joints_out);
    }
    it
}

pub(super) fn boxed(agreement: &Agreement) -> Measure {
    let meaning = "what is outside the box gets no rays";
    let mut it = share(
        MeasureKind::MaskInBox,
        agreement.mask_in_box,
        [0.98, 0.9],
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("the mask holds more than the person, or poses are off".to_owned());
        it.frames.clone_from(&agreement.mask_out);
    }
    it
}

pub(super) fn silhouette(fit: Option<f64>) -> Measure {
    let meaning = "overlap of a rough body around the bones with the mask";
    let mut it = share(MeasureKind::Silhouette, fit, [0.65, 0.45], meaning);
    if it.grade != Grade::Pass {
        it.cause = Some("poses are imprecise, or clothes hide the body".to_owned());
    }
    it
}

/// Least share of image content inside masks for a pass, and for a warning.
pub(super) const IMAGE_IN_MASK: [f64; 2] = [0.85, 0.7];

pub(super) fn image_in_mask(agreement: &Agreement) -> Measure {
    let Some(value) = agreement.image_in_mask else {
        let meaning = "images are not over black, so they can't be compared with masks";
        return measure(
            MeasureKind::ImageInMask,
            Grade::Pass,
            None,
            "not over black".to_owned(),
            meaning,
        );
    };
    let meaning = "share of what images show that is in masks; the rest is learnt as haze";
    let mut it = share(
        MeasureKind::ImageInMask,
        Some(value),
        IMAGE_IN_MASK,
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("masks are of other frames, or rough".to_owned());
        it.frames.clone_from(&agreement.image_out);
    }
    it
}
