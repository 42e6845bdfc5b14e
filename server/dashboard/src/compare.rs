//! Two models side by side: what they are, their curves in one drawing, and their newest pictures.

use super::asker::Asker;
use super::chart::{Chart, Series};
use super::curves::{self, figure};
use super::document::{self, Page};
use super::model::{newest_pictures, of_model, split};
use super::names::Names;
use super::page_error::PageError;
use super::query::Fields;
use super::words::{bytes, name, page_of, span, told, whole};
use axum::extract::RawQuery;
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::v1::{Checkpoint, Job, ListModelsRequest, MetricPoint, Model, job};
use yoto_store::JobKind;

/// Models to choose from, the newest.
const CHOICES: i32 = 200;
/// Newest trainings among which one with figures is looked for.
const TRAININGS: u32 = 5;
/// Most people of a model that are named.
const NAMED: usize = 24;

/// One of the two.
struct Side {
    model: Model,
    people: Vec<String>,
    /// Figures of the newest training that has some.
    figures: Vec<MetricPoint>,
    best: Option<Checkpoint>,
    pictures: Markup,
}

/// `/compare?one={id}&other={id}`
pub(crate) async fn page(asker: Asker, RawQuery(query): RawQuery) -> Result<Page, PageError> {
    let query = Fields::of_query(query);
    let request = ListModelsRequest {
        page_size: CHOICES,
        ..ListModelsRequest::default()
    };
    let choices = asker.services().models.list_models(asker.request(request));
    let choices = choices.await?.into_inner().models;
    let chosen = [query.get("one"), query.get("other")];
    let compared = match chosen {
        ["", _] | [_, ""] => None,
        chosen => Some(sides(&asker, chosen).await?),
    };
    let body = html! {
        h1 { "Comparison of two models" }
        (form(&choices, chosen))
        @if let Some(sides) = &compared { (comparison(sides)) }
    };
    Ok(document::live("Comparison", "/models", "", body))
}

fn form(choices: &[Model], chosen: [&str; 2]) -> Markup {
    let fields = [("one", "One"), ("other", "The other")];
    html! {
        @if choices.len() < 2 { p .empty { "There are fewer than two models." } }
        form method="get" action="/compare" {
            @for ((field, label), chosen) in fields.into_iter().zip(chosen) {
                label { (label) " "
                    select name=(field) required {
                        @for model in choices {
                            @let id = model.name.trim_start_matches("models/");
                            option value=(id) selected[id == chosen] { (told(&model.display_name)) " (" (told(&model.tier)) ")" }
                        }
                    }
                }
            }
            button { "Compare" }
        }
    }
}

/// The models with these ids, all of which is read at once for both.
async fn sides(asker: &Asker, ids: [&str; 2]) -> Result<[Side; 2], Status> {
    let (backend, tenant) = (asker.backend(), asker.tenant()?);
    let resources = ids.map(|id| format!("models/{id}"));
    let resources = [&*resources[0], &*resources[1]];
    let models = backend.models(&tenant, &resources).await?;
    let done = [job::State::Succeeded];
    let groups = [
        of_model(ids[0], &[JobKind::Train], &[], TRAININGS),
        of_model(ids[1], &[JobKind::Train], &[], TRAININGS),
        of_model(ids[0], &[JobKind::Render], &done, 1),
        of_model(ids[1], &[JobKind::Render], &done, 1),
    ];
    let [one, other, render, other_render] = split(backend.jobs(&tenant, &groups).await?);
    let figures = curves::of(asker, one.iter().chain(&other)).await?;
    let (of_one, of_other) = figures.split_at(one.len());
    let best = backend.best_checkpoints(&tenant, &resources).await?;
    let slots = models.iter().flat_map(|it| it.slots.iter().take(NAMED));
    let names = Names::read(asker, slots.map(|it| &*it.subject)).await?;
    let side = |at: usize, figures: &[Vec<MetricPoint>], render: &[Job]| {
        let model = models.get(at).cloned().unwrap_or_default();
        let slots = model.slots.iter().take(NAMED);
        Side {
            people: slots.map(|it| told(&names.plain(&it.subject))).collect(),
            figures: figures
                .iter()
                .find(|it| !it.is_empty())
                .cloned()
                .unwrap_or_default(),
            best: best.get(resources[at]).cloned(),
            pictures: newest_pictures(render.first()),
            model,
        }
    };
    Ok([side(0, of_one, &render), side(1, of_other, &other_render)])
}

fn comparison(sides: &[Side; 2]) -> Markup {
    html! {
        (table(sides))
        @if sides.iter().any(|it| !it.figures.is_empty()) { (charts(sides)) }
        @if sides.iter().any(|it| !it.pictures.0.is_empty()) {
            div .sides {
                @for side in sides {
                    section { h2 { (name(&side.model.display_name)) } (side.pictures) }
                }
            }
        }
    }
}

/// What a side has in a row of the table.
type Value = fn(&Side) -> String;

fn table(sides: &[Side; 2]) -> Markup {
    let rows: [(&str, Value); 9] = [
        ("Tier", |it| told(&it.model.tier)),
        ("Variant", |it| told(&it.model.variant)),
        ("People", |it| match it.people.is_empty() {
            true => none(),
            false => it.people.join(", "),
        }),
        ("Steps of the newest training", |it| {
            it.figures.last().map_or_else(none, |it| whole(it.step))
        }),
        ("Time of the newest training", |it| {
            it.figures.last().map_or_else(none, |it| span(it.seconds))
        }),
        ("PSNR at its end, dB", |it| {
            figure(it.figures.iter().rev().find_map(|it| it.psnr), 2)
        }),
        ("Step of the best checkpoint", |it| {
            it.best.as_ref().map_or_else(none, |it| whole(it.step))
        }),
        ("PSNR of the best checkpoint, dB", |it| {
            figure(it.best.as_ref().and_then(|it| it.psnr), 2)
        }),
        ("Bytes of the best checkpoint", |it| {
            it.best.as_ref().map_or_else(none, |it| bytes(it.bytes))
        }),
    ];
    let measured = sides.iter().all(|it| !it.figures.is_empty());
    html! {
        div .scroll tabindex="0" role="group" aria-label="Table" { table .compared {
            thead { tr { th { "Figure" } @for it in sides { th { a href=(page_of(&it.model.name)) { (name(&it.model.display_name)) } } } } }
            tbody { @for (title, value) in rows {
                tr { th scope="row" { (title) } @for it in sides { td { bdi { (value(it)) } } } }
            } }
        } }
        @if measured && people(&sides[0]) != people(&sides[1]) {
            p .detail { "Each PSNR is measured on held-out frames of the model's own people, so figures of different people do not say which model is better." }
        }
    }
}

/// Resources of a model's people, in order.
fn people(side: &Side) -> Vec<&str> {
    let mut people: Vec<&str> = side
        .model
        .slots
        .iter()
        .map(|it| it.subject.as_str())
        .collect();
    people.sort_unstable();
    people
}

fn none() -> String {
    figure(None, 0)
}

/// The second model's curves are in front.
fn charts(sides: &[Side; 2]) -> Markup {
    let series = |x: fn(&MetricPoint) -> f64, y: fn(&MetricPoint) -> Option<f64>| -> Vec<Series> {
        let of = |(at, side): (usize, &Side)| Series {
            points: side
                .figures
                .iter()
                .filter_map(|it| Some((x(it), y(it)?)))
                .collect(),
            earlier: at == 0,
            dots: false,
        };
        sides.iter().enumerate().map(of).collect()
    };
    let steps: fn(&MetricPoint) -> f64 = |it| it.step as f64;
    let charts = [
        (
            "PSNR on held-out frames over steps, dB",
            "steps",
            series(steps, |it| it.psnr),
            2,
            false,
        ),
        (
            "PSNR on held-out frames over time, dB",
            "seconds",
            series(|it| it.seconds, |it| it.psnr),
            2,
            false,
        ),
        ("Loss", "steps", series(steps, |it| it.loss), 5, true),
    ];
    html! {
        p .legend {
            span .key .earlier { } (name(&sides[0].model.display_name)) " "
            span .key { } (name(&sides[1].model.display_name))
        }
        div .charts {
            @for (title, x, series, decimals, log) in charts {
                (Chart { title, x, series, decimals, may_be_log: (false, log) }.draw())
            }
        }
    }
}
