//! The measured time and fidelity of a checkpoint's render settings.

use super::asker::Asker;
use super::chart::{Chart, Series};
use super::words::told;
use maud::{Markup, html};
use serde::Deserialize;
use tonic::{Code, Status};
use yoto_proto::v1::Checkpoint;

/// Most settings that are drawn.
const MOST: usize = 1000;
/// Longest file of figures that is read, bytes.
const LONGEST: usize = 8 << 20;

/// The figures as `yoto tradeoff` writes them, as far as they are shown.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Curve {
    machine: Machine,
    size: u32,
    views: u32,
    points: Vec<Point>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Machine {
    device: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Point {
    seconds: f64,
    psnr_to_full: f64,
    psnr: Option<f64>,
}

impl Point {
    fn fidelity(&self) -> f64 {
        self.psnr.unwrap_or(self.psnr_to_full)
    }
}

/// The curve of the first of `checkpoints` that has one; nothing if none has.
///
/// # Errors
/// When the service can't read it.
pub(crate) async fn of(asker: &Asker, checkpoints: &[Checkpoint]) -> Result<Markup, Status> {
    let mut measured = checkpoints.iter().filter(|it| it.tradeoff.is_some());
    let found = measured
        .find(|it| it.best)
        .or_else(|| checkpoints.iter().find(|it| it.tradeoff.is_some()));
    let Some((checkpoint, object)) = found.and_then(|it| Some((it, it.tradeoff.as_ref()?))) else {
        return Ok(html! {});
    };
    let json = match asker.backend().object(object, LONGEST).await {
        Ok(Some(json)) => json,
        Ok(None) => {
            tracing::warn!(checkpoint = checkpoint.name, "the trade-off is too long");
            return Ok(html! {});
        }
        // It was replaced meanwhile.
        Err(error) if error.code() == Code::NotFound => return Ok(html! {}),
        Err(error) => return Err(error),
    };
    match serde_json::from_slice(&json) {
        Ok(curve) => Ok(drawn(&curve, checkpoint.step)),
        Err(error) => {
            tracing::warn!(checkpoint = checkpoint.name, %error, "the trade-off can't be read");
            Ok(html! {})
        }
    }
}

fn drawn(curve: &Curve, step: u64) -> Markup {
    let points = curve.points.iter().take(MOST);
    let mut points: Vec<(f64, f64)> = points.map(|it| (it.seconds, it.fidelity())).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The settings of which none is both faster and closer.
    let mut best = f64::NEG_INFINITY;
    let front = points.iter().copied().filter(|it| {
        let better = it.1 > best;
        best = best.max(it.1);
        better
    });
    let front = Series {
        points: front.collect(),
        ..Series::default()
    };
    let all = Series {
        points,
        dots: true,
        ..Series::default()
    };
    let chart = Chart {
        title: "Fidelity over time of a frame, dB",
        x: "seconds per frame",
        series: vec![all, front],
        decimals: 2,
        may_be_log: (true, false),
    };
    html! {
        h2 { "Speed and accuracy" }
        div .charts { (chart.draw()) }
        p .detail {
            "Measured at step " (step) " on " (told(&curve.machine.device)) ", with " (curve.views)
            " held-out frames of " (curve.size) " pixels. The line connects the settings of which none is both faster and closer."
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stored_curve_is_drawn() {
        let json = r#"{"version": 2, "machine": {"cpu": "x", "cores": 2, "device": "<cpu>"}, "size": 128, "views": 4,
            "points": [{"settings": {}, "seconds": 1.0, "psnr_to_full": 100.0, "psnr": 25.0},
                       {"settings": {}, "seconds": 0.01, "psnr_to_full": 30.0, "psnr": 21.0},
                       {"settings": {}, "seconds": 0.5, "psnr_to_full": 20.0}]}"#;
        let curve: Curve = serde_json::from_str(json).expect("a curve");
        let shown = drawn(&curve, 7).into_string();
        assert_eq!(shown.matches("class=\"dot\"").count(), 3, "{shown}");
        assert_eq!(shown.matches("class=\"line\"").count(), 1);
        assert!(
            shown.contains("&lt;cpu&gt;") && shown.contains("21.00 at 0.01, 25.00 at 1"),
            "{shown}"
        );
    }
}
