//! Every call of the contract and every page, for every kind of caller. The contract's descriptors are walked, so that a new
//! call is covered without being named here.

use crate::support::{SCOPES, Service};
use crate::tenants::calls::{Answer, call, call_path};
use crate::tenants::requests::{is_of_whole_service, methods, scope};
use prost_reflect::DynamicMessage;
use tonic::Code;
use tonic::transport::Channel;
use yoto_proto::key::{Key, connection};
use yoto_proto::v1::Scope;
use yoto_server::Admission;

/// A key, what is told to it if it is refused everywhere, and otherwise its tenant and its scope.
struct Caller {
    name: String,
    key: Option<Key>,
    outcome: Outcome,
}

enum Outcome {
    Refused(&'static str),
    Allowed { tenant: &'static str, scope: Scope },
}

/// All kinds of callers.
async fn callers(service: &Service) -> Vec<Caller> {
    let mut callers = Vec::new();
    let mut refused = |name: &str, key, reason| {
        callers.push(Caller {
            name: name.to_owned(),
            key,
            outcome: Outcome::Refused(reason),
        });
    };
    refused("no key", None, "KEY_MISSING");
    let unknown = format!("yoto_{}", "0".repeat(64));
    let unknown: Key = unknown.parse().expect("a key");
    refused("an unknown key", Some(unknown), "KEY_UNKNOWN");
    let all = [Scope::Read, Scope::Write, Scope::Operate];
    for (name, scopes) in [("", &all[..]), ("worker's ", &[Scope::Work])] {
        let expired = service.key("default", scopes).await;
        let id = expired.name.trim_start_matches("keys/");
        let ended = format!("UPDATE keys SET expire_time = 1.5 WHERE id = '{id}'");
        service.database.run(&ended).await;
        refused(
            &format!("an expired {name}key"),
            Some(expired.secret),
            "KEY_EXPIRED",
        );
        let revoked = service.key("default", scopes).await;
        service.revoke(&revoked.name).await;
        refused(
            &format!("a revoked {name}key"),
            Some(revoked.secret),
            "KEY_REVOKED",
        );
    }
    for tenant in ["default", "other"] {
        for scope in SCOPES {
            let key = service.key(tenant, &[scope]).await;
            callers.push(Caller {
                name: format!("a key of {tenant} with {}", scope.as_str_name()),
                key: Some(key.secret),
                outcome: Outcome::Allowed { tenant, scope },
            });
        }
    }
    callers
}

/// Whether the layer of access has let the call through.
fn is_through(answer: &Answer) -> bool {
    !matches!(answer.code, Code::Unauthenticated | Code::PermissionDenied)
}

#[tokio::test]
async fn every_call_is_answered_to_those_who_may_make_it_and_to_nobody_else() {
    let service = Service::start().await;
    let callers = callers(&service).await;
    let (mut cells, mut faults) = (0, Vec::new());
    // Whatever admits callers without a key does so no more.
    for admission in [Admission::Nobody, Admission::Anyone] {
        let door = service.door(admission);
        for method in methods() {
            let request = DynamicMessage::new(method.input());
            for caller in &callers {
                let connection = connection(door.clone(), caller.key.clone());
                let answer = call(connection, &method, &request).await;
                let right = match &caller.outcome {
                    Outcome::Refused(reason) => {
                        answer.code == Code::Unauthenticated && answer.holds(reason)
                    }
                    Outcome::Allowed { tenant, scope: has } => {
                        let own = *tenant == "default" || !is_of_whole_service(&method);
                        match *has == scope(&method) && own {
                            true => is_through(&answer),
                            false => {
                                answer.code == Code::PermissionDenied
                                    && answer.holds("SCOPE_MISSING")
                            }
                        }
                    }
                };
                if !right {
                    faults.push(format!(
                        "{} with {}: {answer:?}",
                        method.full_name(),
                        caller.name
                    ));
                }
                cells += 1;
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(cells, 2 * methods().len() * 14);
}

const REFLECTION: &str = "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo";
const HEALTH: &str = "/grpc.health.v1.Health/Check";

#[tokio::test]
async fn health_is_open_reflection_asks_for_any_key_and_nothing_else_is_there() {
    let service = Service::start().await;
    let callers = callers(&service).await;
    let door = service.door(Admission::Nobody);
    for caller in &callers {
        let ask = async |path: &str| {
            let connection = connection(door.clone(), caller.key.clone());
            call_path(connection, path, Vec::new()).await.code
        };
        assert_eq!(ask(HEALTH).await, Code::Ok, "{}", caller.name);
        let reflected = ask(REFLECTION).await;
        let refused = matches!(caller.outcome, Outcome::Refused(_));
        assert_eq!(
            reflected == Code::Unauthenticated,
            refused,
            "{}",
            caller.name
        );
        for path in ["/yoto.v1.JobService/Nothing", "/metrics", "/"] {
            let told = ask(path).await;
            assert!(told != Code::Ok, "{} is answered at {path}", caller.name);
        }
        let nothing = ask("/yoto.v1.NoService/Get").await;
        assert_eq!(nothing, Code::Unimplemented, "{}", caller.name);
    }
}

#[tokio::test]
async fn without_keys_everybody_whom_the_listener_admits_may_do_everything() {
    let service = Service::start().await;
    let open: Channel = service.door(Admission::Anyone);
    let closed = service.door(Admission::Nobody);
    for method in methods() {
        let request = DynamicMessage::new(method.input());
        let ask = |door: &Channel| call(connection(door.clone(), None), &method, &request);
        // Making the first key would end it.
        if method.name() != "CreateKey" {
            let answer = ask(&open).await;
            assert!(is_through(&answer), "{}: {answer:?}", method.full_name());
        }
        let answer = ask(&closed).await;
        assert_eq!(answer.code, Code::Unauthenticated, "{}", method.full_name());
    }
}
