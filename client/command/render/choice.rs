//! Settings that a render chose for a goal, for people.

use yoto_proto::v1::RenderChoice;

/// The chosen settings, with predicted and actual figures, in two lines.
pub(crate) fn kept(choice: &RenderChoice) -> String {
    let settings = choice.settings.unwrap_or_default();
    let decibels = |psnr: Option<f64>| {
        psnr.map_or_else(|| "unknown".to_owned(), |psnr| format!("{psnr:.2} dB"))
    };
    let seen = match choice.psnr {
        Some(psnr) => format!("{psnr:.2} dB on {} pictures", choice.pictures_with_truth),
        None => "no ground truth for these pictures".to_owned(),
    };
    format!(
        "chosen: {} samples per ray, likelihood bound {}, least light {}, {}, {:.0} % of the \
         resolution, {} % of the splats\n\
         promised {:.4} s per frame and {} (on {}); took {:.4} s per frame, {seen}",
        settings.samples,
        settings.epsilon,
        settings.min_transmittance,
        if settings.bf16 { "bf16" } else { "f32" },
        100.0 * settings.scale,
        match settings.splats {
            // Of a worker of an earlier version.
            0.0 => 100.0,
            share => 100.0 * share,
        },
        choice.predicted_seconds_per_frame,
        decibels(choice.predicted_psnr),
        choice.measured_on,
        choice.seconds_per_frame,
    )
}

/// A note that splats were drawn with the model's own settings, without a measured curve, in `seconds` per
/// frame.
pub(crate) fn as_they_are(seconds: f64) -> String {
    format!(
        "splats with the model's own settings: {seconds:.4} s per frame, {:.0} per second, without encoding",
        1.0 / seconds.max(f64::MIN_POSITIVE)
    )
}

/// A note that a frame took longer than the `limit` in seconds, and a likely reason; `device` has
/// rendered it.
pub(crate) fn over(limit: f64, choice: &RenderChoice, device: &str) -> Option<String> {
    let taken = choice.seconds_per_frame;
    let reason = if choice.measured_on != device {
        format!(
            "the trade-off was measured on {}, this was rendered on {device}: measure it there with \
             `yoto tradeoff`",
            choice.measured_on
        )
    } else {
        "the machine was busier than at the measurement, or these pictures show more of the person; \
         a lower limit leaves room for that"
            .to_owned()
    };
    (taken > limit).then(|| {
        format!(
            "over your limit of {limit} s by {:.4} s: {reason}",
            taken - limit
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splats_without_a_curve_have_their_speed_told() {
        let said = as_they_are(0.02);
        assert!(said.contains("0.0200 s per frame, 50 per second"), "{said}");
    }

    #[test]
    fn a_limit_that_was_not_kept_is_admitted() {
        let choice = |seconds| RenderChoice {
            measured_on: "a CPU".into(),
            seconds_per_frame: seconds,
            ..RenderChoice::default()
        };
        assert_eq!(over(0.1, &choice(0.1), "a CPU"), None);
        let said = over(0.1, &choice(0.144), "a CPU").expect("over");
        assert!(
            said.starts_with("over your limit of 0.1 s by 0.0440 s: the machine"),
            "{said}"
        );
        let said = over(0.1, &choice(0.144), "a GPU").expect("over");
        assert!(
            said.contains("measured on a CPU, this was rendered on a GPU"),
            "{said}"
        );
    }
}
