//! Loss and quality of trainings over their steps.

use super::asker::Asker;
use super::chart::{Chart, Series};
use super::words::whole;
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::progress::duration;
use yoto_proto::v1::{Job, MetricPoint};

/// Rows of the table of figures.
const ROWS: usize = 12;

/// The figures of jobs over their steps, in the order of the jobs.
///
/// # Errors
/// When the service can't tell.
pub(crate) async fn of<'j>(
    asker: &Asker,
    jobs: impl Iterator<Item = &'j Job>,
) -> Result<Vec<Vec<MetricPoint>>, Status> {
    let names: Vec<&str> = jobs.map(|it| &*it.name).collect();
    let mut found = asker.backend().figures(&asker.tenant()?, &names).await?;
    let figures = names.iter().map(|it| found.remove(*it).unwrap_or_default());
    Ok(figures.collect())
}

/// The curves of trainings, the one of interest last; nothing without figures.
pub(crate) fn curves(trainings: &[Vec<MetricPoint>]) -> Markup {
    let series = |value: fn(&MetricPoint) -> Option<f64>| -> Vec<Series> {
        let mut all: Vec<Series> = trainings
            .iter()
            .map(|points| Series {
                points: points
                    .iter()
                    .filter_map(|it| Some((it.step as f64, value(it)?)))
                    .collect(),
                earlier: true,
                dots: false,
            })
            .collect();
        if let Some(last) = all.last_mut() {
            last.earlier = false;
        }
        all
    };
    let loss = Chart {
        title: "Loss",
        x: "steps",
        series: series(|it| it.loss),
        decimals: 5,
        may_be_log: (false, true),
    };
    let psnr = Chart {
        title: "PSNR on held-out frames, dB",
        x: "steps",
        series: series(|it| it.psnr),
        decimals: 2,
        may_be_log: (false, false),
    };
    let figures = trainings.last().map_or(&[][..], Vec::as_slice);
    html! {
        div .charts { (psnr.draw()) (loss.draw()) }
        @if !figures.is_empty() { (table(figures)) }
    }
}

/// Whether there is anything to draw.
pub(crate) fn any(trainings: &[Vec<MetricPoint>]) -> bool {
    trainings.iter().any(|it| !it.is_empty())
}

/// A few of the figures, evenly spread, with the last one.
fn table(points: &[MetricPoint]) -> Markup {
    let every = points.len().div_ceil(ROWS).max(1);
    let shown = points
        .iter()
        .enumerate()
        .filter(|(at, _)| (points.len() - 1 - at).is_multiple_of(every));
    // PSNR is measured at few steps: a row has the last one up to it.
    let measured =
        |at: usize, of: fn(&MetricPoint) -> Option<f64>| points[..=at].iter().rev().find_map(of);
    html! {
        details #figures {
            summary { "Figures" }
            div .scroll tabindex="0" role="group" aria-label="Table" { table {
                thead { tr { th { "Step" } th { "Time" } th { "Loss" } th { "PSNR, dB" } th { "SSIM" } } }
                tbody {
                    @for (at, point) in shown {
                        tr {
                            td { (whole(point.step)) }
                            td { (duration(point.seconds)) }
                            td { (figure(point.loss, 5)) }
                            td { (figure(measured(at, |it| it.psnr), 2)) }
                            td { (figure(measured(at, |it| it.ssim), 4)) }
                        }
                    }
                }
            } }
        }
    }
}

/// A figure, or a dash without it.
pub(crate) fn figure(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |it| format!("{it:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(number: u64) -> Vec<MetricPoint> {
        let point = |step: u64| MetricPoint {
            step,
            seconds: step as f64,
            loss: Some(1.0 / step as f64),
            psnr: step
                .is_multiple_of(50)
                .then_some(20.0 + step as f64 / 100.0),
            ssim: None,
        };
        (1..=number).map(point).collect()
    }

    #[test]
    fn the_table_has_few_rows_and_the_last_point() {
        let drawn = curves(&[points(7), points(333)]).into_string();
        let rows = drawn.matches("<tr>").count() - 1;
        assert!((1..=ROWS).contains(&rows), "{rows}");
        assert!(
            drawn.contains("<td>333</td><td>5:33</td><td>0.00300</td><td>23.00</td>"),
            "{drawn}"
        );
        assert_eq!(
            drawn.matches("class=\"line earlier\"").count(),
            2,
            "{drawn}"
        );
        assert!(any(&[Vec::new(), points(1)]) && !any(&[Vec::new()]));
    }
}
