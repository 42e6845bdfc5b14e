//! Serves every gRPC service of a coordinator on a stream of connections.

mod fault_layer;

use crate::access::{AccessLayer, Admission, SignInPage};
use crate::api::{
    JobApi, KeyApi, KnownWorkers, ModelApi, ObjectApi, RenderApi, ShareApi, StatusApi, StorageApi,
    SubjectApi, TenantApi, UploadApi, WebhookApi, WorkerApi,
};
use crate::audit;
use crate::context::Context;

use crate::error::ServerError;
use crate::health::{self, Health};
use crate::pages::{self, Coordinated};
use axum::Router;
use fault_layer::FaultLayer;
use yoto_dashboard::Services;

use crate::sign_in;
use crate::traffic::{Traffic, TrafficLayer};
use futures::{Stream, StreamExt};
use std::future::Future;
use std::sync::Arc;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio_util::sync::CancellationToken;
use tonic::service::Routes;
use tonic::transport::Server;
use tonic::transport::server::Connected;
use tonic_health::server::HealthReporter;
use yoto_proto::limits::WINDOW_BYTES;
use yoto_proto::v1::job_service_server::JobServiceServer;
use yoto_proto::v1::key_service_server::KeyServiceServer;
use yoto_proto::v1::model_service_server::ModelServiceServer;
use yoto_proto::v1::object_service_server::ObjectServiceServer;
use yoto_proto::v1::render_service_server::RenderServiceServer;
use yoto_proto::v1::share_service_server::ShareServiceServer;
use yoto_proto::v1::status_service_server::StatusServiceServer;
use yoto_proto::v1::storage_service_server::StorageServiceServer;
use yoto_proto::v1::subject_service_server::SubjectServiceServer;
use yoto_proto::v1::tenant_service_server::TenantServiceServer;
use yoto_proto::v1::upload_service_server::UploadServiceServer;
use yoto_proto::v1::webhook_service_server::WebhookServiceServer;
use yoto_proto::worker::v1::worker_service_server::WorkerServiceServer;

/// All services with the pages beside them, and the handle of the health service among them.
async fn routes(
    context: &Arc<Context>,
    drain: &CancellationToken,
) -> Result<(Routes, HealthReporter), ServerError> {
    let context = || Arc::clone(context);
    let drain = || drain.clone();
    let limit = context().config.traffic.message_bytes;
    let (reporter, health_service) = tonic_health::server::health_reporter();
    health::set(&reporter, Health::default()).await;
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(yoto_proto::DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let subjects = SubjectServiceServer::new(SubjectApi { context: context() });
    let uploads = UploadServiceServer::new(UploadApi { context: context() });
    let models = ModelServiceServer::new(ModelApi { context: context() });
    let jobs = JobServiceServer::new(JobApi {
        context: context(),
        drain: drain(),
    });
    let objects = ObjectServiceServer::new(ObjectApi { context: context() });
    let renders = RenderServiceServer::new(RenderApi { context: context() });
    let status = StatusServiceServer::new(StatusApi { context: context() });
    let storage = StorageServiceServer::new(StorageApi { context: context() });
    let keys = KeyServiceServer::new(KeyApi { context: context() });
    let shares = ShareServiceServer::new(ShareApi { context: context() });
    let tenants = TenantServiceServer::new(TenantApi { context: context() });
    let webhooks = WebhookServiceServer::new(WebhookApi { context: context() });
    let workers = WorkerServiceServer::new(WorkerApi {
        context: context(),
        drain: drain(),
        known: KnownWorkers::default(),
    });
    let routes = Routes::new(health_service)
        .add_service(reflection().build_v1()?)
        // Clients in Python know only this version.
        .add_service(reflection().build_v1alpha()?)
        .add_service(subjects.max_decoding_message_size(limit))
        .add_service(uploads.max_decoding_message_size(limit))
        .add_service(models.max_decoding_message_size(limit))
        .add_service(jobs.max_decoding_message_size(limit))
        .add_service(objects.max_decoding_message_size(limit))
        .add_service(renders.max_decoding_message_size(limit))
        .add_service(status)
        .add_service(keys.max_decoding_message_size(limit))
        .add_service(shares.max_decoding_message_size(limit))
        .add_service(storage)
        .add_service(tenants)
        .add_service(webhooks.max_decoding_message_size(limit))
        .add_service(workers.max_decoding_message_size(limit));
    let mut routes = routes;
    let router = std::mem::take(routes.axum_router_mut());
    let recorded =
        || axum::middleware::from_fn_with_state(Arc::clone(&context().audit), audit::record);
    let router = router.layer(recorded());
    let calls =
        yoto_http::transcoding::routes(router.clone(), Arc::new(ObjectApi { context: context() }));
    let pages = dashboard(context(), drain(), calls.clone()).layer(recorded());
    let router = router
        .merge(pages)
        .merge(calls)
        .merge(sign_in::routes(context()));
    *routes.axum_router_mut() = pages::pages(router, context());
    Ok((routes, reporter))
}

/// The page in place of one that somebody may not see without a key.
fn sign_in_page(context: &Arc<Context>) -> SignInPage {
    let context = Arc::clone(context);
    Arc::new(move |to, why| sign_in::asked(context.config.oidc.as_ref(), to, why))
}

/// The pages for people, over the services of the contract.
fn dashboard(context: Arc<Context>, drain: CancellationToken, calls: Router) -> Router {
    let shared = || Arc::clone(&context);
    let services = Services {
        subjects: Arc::new(SubjectApi { context: shared() }),
        models: Arc::new(ModelApi { context: shared() }),
        jobs: Arc::new(JobApi {
            context: shared(),
            drain: drain.clone(),
        }),
        objects: Arc::new(ObjectApi { context: shared() }),
        status: Arc::new(StatusApi { context: shared() }),
        tenants: Arc::new(TenantApi { context: shared() }),
        shares: Arc::new(ShareApi { context: shared() }),
    };
    yoto_dashboard::routes(services, Arc::new(Coordinated(context)), drain, calls)
}

/// Serves those whom `admission` admits until `shutdown` is ready or the coordinator stops; then: health says NOT_SERVING,
/// no new leases, watch streams end, and open calls have the configured grace to finish.
pub(crate) async fn serve<I, IO, IE>(
    context: Arc<Context>,
    admission: Admission,
    incoming: I,
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServerError>
where
    I: Stream<Item = Result<IO, IE>>,
    IO: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
    IE: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    let drain = context.stop.child_token();
    if admission == Admission::Nobody
        && context.config.oidc.is_none()
        && !context.callers.keys().await?.any()
    {
        tracing::warn!(
            "the service has no key yet, so nobody can call it: `yoto key create` makes one on this host, with --data or --database"
        );
    }
    let (routes, reporter) = routes(&context, &drain).await?;
    let signal = async {
        tokio::select! {
            () = shutdown => {}
            () = drain.cancelled() => {}
            () = context.health.follow(&reporter) => {}
        }
        let leaving = Health {
            leaving: true,
            ..Health::default()
        };
        health::set(&reporter, leaving).await;
        drain.cancel();
    };
    let limits = &context.config.traffic;
    let traffic = Traffic::new(limits);
    let admitting = Arc::clone(&traffic);
    let incoming = incoming.filter_map(move |connection| {
        let admitted = match connection {
            Ok(io) => admitting.admit(io).map(Ok),
            Err(error) => Some(Err(error)),
        };
        std::future::ready(admitted)
    });
    let access = AccessLayer {
        callers: Arc::clone(&context.callers),
        admission,
        sign_in: sign_in_page(&context),
    };
    let faults = context.config.faults.clone().map(FaultLayer);
    let cors = yoto_http::cors(&context.config.allow_origins)
        .map_err(|error| ServerError::Config(error.to_string()))?;
    let serving = Server::builder()
        // For the pages; gRPC needs HTTP/2.
        .accept_http1(true)
        .initial_stream_window_size(WINDOW_BYTES)
        .initial_connection_window_size(WINDOW_BYTES)
        .max_concurrent_streams(limits.connection_calls)
        .http2_keepalive_interval(Some(limits.ping))
        .http2_keepalive_timeout(Some(limits.ping))
        .layer(TrafficLayer(traffic))
        .layer(tower::util::option_layer(cors))
        .layer(tower::util::option_layer(faults))
        .layer(access)
        .layer(yoto_http::WebLayer)
        .add_routes(routes)
        .serve_with_incoming_shutdown(incoming, signal);
    // A client that keeps an idle connection open would keep the server alive for ever.
    let bound = async {
        drain.cancelled().await;
        tokio::time::sleep(context.config.shutdown_grace).await;
    };
    tokio::select! {
        served = serving => Ok(served?),
        () = bound => {
            tracing::warn!("connections were still open after the shutdown's grace");
            Ok(())
        }
    }
}
