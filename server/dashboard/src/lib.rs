//! The pages for people: what the service has, what it does, and how well.
//!
//! ```text
//! request ─► Asker: who asks ─► the services of `api`, called as gRPC calls them ─► a page of maud, or events
//! ```
//!
//! A page changes nothing by itself: [`asker`] makes all calls, with the tenant that the layers of `serve` have put
//! into the request. So a page has the rights, the limits and the errors of the calls behind it. What a page mentions beside the
//! answers of its calls it [`reads`](Reads) at once, for the same tenant. Pages answer GET and HEAD;
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
mod cost;
mod curves;
mod document;
mod events;
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
mod page_error;
mod people;
mod person;
mod progress;
mod query;
mod reads;
mod report;
mod routes;
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
pub use reads::Reads;
pub use routes::{PageRule, RULES};

use axum::Router;
use axum::middleware::{from_fn, map_response};
use axum::routing::get;
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
    let pages = routes::all().into_iter();
    pages
        .fold(Router::new(), |router, page| {
            router.route(page.path, page.answers)
        })
        .route("/assets/{file}", get(assets::file))
        .layer(map_response(headers::secured))
        .layer(from_fn(cost::told))
        .with_state(site)
}
