//! The models of the service.

use super::asker::Asker;
use super::document::{self, Page};
use super::names::Names;
use super::page_error::PageError;
use super::people::more;
use super::query::Fields;
use super::words::{ago, badge, count, name, page_of, told};
use axum::extract::RawQuery;
use maud::{Markup, html};
use yoto_proto::v1::{ListModelsRequest, Model};

/// Models per page.
const PER_PAGE: i32 = 50;
/// Most people of a model that are named in the list.
const NAMED: usize = 4;

/// `/models`
pub(crate) async fn page(asker: Asker, RawQuery(query): RawQuery) -> Result<Page, PageError> {
    let query = Fields::of_query(query);
    let request = ListModelsRequest {
        page_size: PER_PAGE,
        page_token: query.get("page").to_owned(),
    };
    let list = asker.services().models.list_models(asker.request(request));
    let list = list.await?.into_inner();
    let names = Names::read(&asker, people(&list.models)).await?;
    let body = html! {
        h1 { "Models" }
        @if list.models.is_empty() {
            p .empty { "None yet. " code { "yoto train NAME --subjects PEOPLE" } " makes one and trains it." }
        } @else {
            (table(&list.models, &names, asker.now()))
            @if list.models.len() > 1 { p { a href="/compare" { "Compare two models" } } }
        }
        (more("/models", &list.next_page_token))
    };
    Ok(document::live("Models", "/models", "", body))
}

/// The people whom [`table`] names.
pub(crate) fn people(models: &[Model]) -> impl Iterator<Item = &str> {
    let slots = models.iter().flat_map(|it| it.slots.iter().take(NAMED));
    slots.map(|it| it.subject.as_str())
}

/// Models, one per row.
pub(crate) fn table(models: &[Model], names: &Names, now: f64) -> Markup {
    let mut rows = Vec::new();
    for model in models {
        let slots = model.slots.iter().take(NAMED);
        let people = slots.map(|slot| told(&names.plain(&slot.subject)));
        let mut people: Vec<String> = people.collect();
        if model.slots.len() > NAMED {
            people.push(format!("{} more", model.slots.len() - NAMED));
        }
        let trained = model.slots.iter().filter(|it| it.trained).count();
        rows.push(html! {
            tr {
                th scope="row" { a href=(page_of(&model.name)) { (name(&model.display_name)) } }
                td { (told(&model.tier)) }
                td .text { bdi { (people.join(", ")) } }
                td {
                    @match (trained, model.slots.len()) {
                        (_, 0) => (badge("calm", "nobody in it")),
                        (0, _) => (badge("calm", "not trained")),
                        (some, all) if some == all => (badge("good", "trained")),
                        (some, all) => (badge("warn", &format!("{some} of {} trained", count(all as u64, "person").replace("persons", "people")))),
                    }
                }
                td { (ago(now, model.create_time.as_ref())) }
            }
        });
    }
    html! {
        div .scroll tabindex="0" role="group" aria-label="Table" { table {
            thead { tr { th { "Model" } th { "Tier" } th { "People" } th { "State" } th { "Made" } } }
            tbody { @for row in rows { (row) } }
        } }
    }
}
