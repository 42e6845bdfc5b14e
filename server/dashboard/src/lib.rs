//! The pages for people: what the service has, what it does, and how well.
//!
//! ```text
//! request ─► Asker: who asks ─► the services of `api`, called as gRPC calls them ─► a page of maud, or events
//! ```
//!
//! A page reads and changes nothing by itself: [`asker`] makes all calls, with the tenant that the layers of `serve` have put
//! into the request. So a page has the rights, the limits and the errors of the calls behind it. Pages answer GET and HEAD;
//! what changes something is a form with a token ([`token`]), or a request of the script that sends a person's files, with the same
//! token in a header ([`upload`]).
//!
//! The document of a page is complete without a script. With it, the page listens to [`events`], asks for its own
//! document again after a change, and takes over what is different (`assets/page.js`). There is therefore one way from data
//! to HTML, and nothing accumulates in a page that stays open.

mod actions;
mod asker;
mod assets;
mod avatar;
mod backend;
mod chart;
mod compare;
mod curves;
mod document;
mod events;
mod fault;
mod files;
mod findings;
mod headers;
mod job;
mod jobs;
mod model;
mod models;
mod names;
mod orders;
mod outcome;
mod overview;
mod people;
mod person;
mod progress;
mod query;
mod report;
mod service;
mod shares;
mod token;
mod tradeoff;
mod upload;
mod usage;
mod words;
mod workers;

pub use backend::{Backend, Services};
pub use document::outside;
pub use query::Fields;

use axum::Router;
use axum::middleware::map_response;
use axum::routing::{get, post, put};
use std::sync::Arc;
use tokio_util::sync::CancellationToken;

/// All pages. `drain` ends their streams of events, which would otherwise delay a shutdown. `calls` are the calls over HTTP, some
/// of which the script of a page makes.
pub fn routes(
    services: Services,
    backend: Arc<dyn Backend>,
    drain: CancellationToken,
    calls: Router,
) -> Router {
    let site = Arc::new(asker::Site {
        services,
        backend,
        drain,
        calls,
    });
    Router::new()
        .route("/", get(overview::page))
        .route("/people", get(people::page))
        .route("/people/{id}", get(person::page))
        .route("/people/{id}/avatar", post(avatar::make))
        .route("/people/upload/person", post(upload::person))
        .route("/people/upload/files", post(upload::begin))
        .route("/people/upload/files/{id}", get(upload::state))
        .route("/people/upload/files/{id}/{file}", put(upload::write))
        .route("/people/upload/finish/{id}", post(upload::finish))
        .route("/people/upload/cancel/{id}", post(upload::cancel))
        .route(
            "/people/upload/cancel-capture/{id}",
            post(upload::cancel_capture),
        )
        .route("/models", get(models::page))
        .route("/models/{id}", get(model::page))
        .route("/models/{id}/report.html", get(report::page))
        .route("/models/{id}/train", post(orders::train))
        .route("/models/{id}/player", post(orders::player))
        .route("/models/{id}/film", post(orders::film))
        .route("/compare", get(compare::page))
        .route("/jobs", get(jobs::page))
        .route("/jobs/{id}", get(job::page))
        .route("/jobs/{id}/cancel", post(actions::cancel))
        .route("/jobs/{id}/retry", post(actions::retry))
        .route("/jobs/{id}/share", post(shares::create))
        .route("/shares/{id}/revoke", post(shares::revoke))
        .route("/jobs/{id}/files/{file}", get(files::of_job))
        .route("/captures/{id}/thumbnail.png", get(files::thumbnail))
        .route("/workers", get(workers::page))
        .route("/workers/cordon", post(actions::cordon))
        .route("/workers/uncordon", post(actions::uncordon))
        .route("/service", get(service::page))
        .route("/sign-out", post(actions::sign_out))
        .route("/events", get(events::stream))
        .route("/assets/{file}", get(assets::file))
        .layer(map_response(headers::secured))
        .with_state(site)
}
