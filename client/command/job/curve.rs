//! `yoto job curve`: loss and held-out quality of a training over its steps.

use super::JobArgs;
use yoto_client::YotoClient;
use yoto_proto::v1::MetricPoint;
use yoto_terminal::chart::chart;
use yoto_terminal::output;
use yoto_terminal::progress::duration;

pub(crate) const AFTER_HELP: &str = "\
The service keeps about a thousand points of a training, closer together at its beginning. --output json prints all
of them: step, seconds, loss, and PSNR and SSIM on held-out frames where they were measured.

Examples:
  yoto job curve 9f31c2aa
  yoto job curve 9f31c2aa --output json > curve.json";

pub(crate) async fn show(which: &JobArgs) -> anyhow::Result<()> {
    let (client, job): (YotoClient, _) = which.find().await?;
    let points = client.job_metrics(&job.name).await?;
    output::put("points", output::messages(&points));
    say!("{}", curve(&points));
    Ok(())
}

/// The curves of `points`, and the last figures.
fn curve(points: &[MetricPoint]) -> String {
    let Some(last) = points.last() else {
        return "no figures yet: trainings report them".to_owned();
    };
    let steps = |it: &MetricPoint| it.step as f64;
    let loss = points.iter().filter_map(|it| Some((steps(it), it.loss?)));
    let loss: Vec<(f64, f64)> = loss.collect();
    let measured = points.iter().filter_map(|it| Some((steps(it), it.psnr?)));
    let psnr: Vec<(f64, f64)> = measured.collect();
    let mut parts = Vec::new();
    for (title, drawn) in [
        ("loss", chart(&loss, |y| format!("{y:.4}"))),
        (
            "PSNR on held-out frames, dB",
            chart(&psnr, |y| format!("{y:.2}")),
        ),
    ] {
        if !drawn.is_empty() {
            parts.push(format!("{title}\n{drawn}\n"));
        }
    }
    let first = points.first().map_or(0, |it| it.step);
    let best = psnr.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let best = best.map_or_else(String::new, |(step, psnr)| {
        format!("; best {psnr:.2} dB at step {step}")
    });
    let loss = last
        .loss
        .map_or_else(String::new, |it| format!("; loss {it:.4}"));
    parts.push(format!(
        "steps {first} to {} in {}{loss}{best}",
        last.step,
        duration(last.seconds)
    ));
    parts.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_has_its_last_figures_and_its_best() {
        let point = |step: u64, psnr| MetricPoint {
            step,
            seconds: step as f64,
            loss: Some(1.0 / step as f64),
            psnr,
            ssim: None,
        };
        assert!(curve(&[]).starts_with("no figures"));
        let text = curve(&[
            point(1, None),
            point(50, Some(21.5)),
            point(100, Some(21.25)),
        ]);
        assert!(text.starts_with("loss\n1.0000 |*"), "{text}");
        assert!(
            text.contains("\n\nPSNR on held-out frames, dB\n21.50 |*"),
            "{text}"
        );
        let end = "steps 1 to 100 in 1:40; loss 0.0100; best 21.50 dB at step 50";
        assert!(text.ends_with(end), "{text}");
        let lone = curve(&[point(1, None)]);
        assert_eq!(lone, "steps 1 to 1 in 0:01; loss 1.0000");
    }
}
