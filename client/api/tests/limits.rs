//! Limits that the operator has set are known before an upload begins.

use yoto_client::{ClientError, FileSource, UploadFile, YotoClient};
use yoto_server::{Coordinator, ServerConfig, in_memory};

#[tokio::test]
async fn what_the_service_would_refuse_is_not_uploaded() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut config = ServerConfig::new(folder.path());
    config.storage.min_free_bytes = 0;
    config.upload.file_bytes = 10;
    config.upload.files = 3;
    let coordinator = Coordinator::open(config).await.expect("opens");
    let (connector, incoming) = in_memory();
    let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
    let client = YotoClient::new(connector.channel());
    let limits = client.limits().await.expect("answers");
    let upload = limits.upload.expect("has them");
    assert_eq!((upload.file_bytes, upload.files), (10, 3));
    assert!(limits.page_entries > 0 && limits.render_pictures > 0);

    let ada = client.create_subject("Ada", "").await.expect("creates");
    let file = |path: &str, bytes: usize| UploadFile {
        path: path.into(),
        source: FileSource::Memory(vec![b' '; bytes]),
    };
    let files = vec![file("poses.json", 2), file("frames/0.png", 11)];
    let refused = client.upload_capture(&ada.name, files, |_| ()).await;
    let Err(ClientError::BadCapture { violations, .. }) = refused else {
        panic!("{refused:?}");
    };
    assert_eq!(violations.len(), 1);
    assert_eq!(violations[0].file, "frames/0.png");
    let ada = client.get_subject(&ada.name).await.expect("is there");
    assert_eq!(ada.captures, [""; 0], "no upload was opened");

    let files = vec![file("poses.json", 2), file("frames/0.png", 10)];
    let uploaded = client.upload_capture(&ada.name, files, |_| ()).await;
    uploaded.expect("fits");
    drop(client);
    coordinator.close().await;
    serving.await.expect("no panic").expect("serves");
}
