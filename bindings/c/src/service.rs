//! [`ServiceName`]: which topic or request service a caller means, and the struct that it expects there.

use ipc_types::dynamic::schema_of;
use ipc_types::service::{Contract, Pattern, SERVICES};
use ipc_types::{
    DynamicClient, DynamicPublisher, DynamicServer, DynamicSubscriber, Ipc, Patience, Schema,
};

use crate::error::Error;

/// A topic or a request service as a caller names it.
#[derive(Clone, Copy, Debug, Default)]
pub struct ServiceName<'a> {
    /// Last part of the service's name.
    pub key: &'a str,
    /// The hash of the layout that the caller was built with, 16 hexadecimal digits.
    pub layout_hash: Option<&'a str>,
    /// The text of the schema that the caller was built with.
    pub schema: Option<&'a str>,
    /// Size of the caller's struct, bytes; 0 when it has none.
    pub size: usize,
}

impl<'a> ServiceName<'a> {
    /// The service with this key, whatever it carries.
    pub fn of_key(key: &'a str) -> ServiceName<'a> {
        ServiceName {
            key,
            ..ServiceName::default()
        }
    }

    /// What the caller expects in the service: its own schema; a struct of the robot's own services, by key or hash, as
    /// this library was built with it; else what lies beside the service.
    fn schema(&self, ipc: &Ipc, pattern: Pattern) -> Result<Schema, Error> {
        let schema = match (self.schema, self.own(pattern)) {
            (Some(text), _) => Schema::parse(text)?,
            (None, Some(contract)) => Schema::from_layout(contract.payload),
            (None, None) => schema_of(ipc, self.key)?,
        };
        self.check(&schema, pattern)?;
        Ok(schema)
    }

    /// The text of the schema by which the caller provides the service.
    fn text(&self, pattern: Pattern) -> Result<String, Error> {
        let text = match (self.schema, self.own(pattern)) {
            (Some(text), _) => text.to_owned(),
            (None, Some(contract)) => contract.schema(),
            (None, None) => {
                return Err(Error::Invalid(format!(
                    "`{}` needs a schema to be provided",
                    self.key
                )));
            }
        };
        self.check(&Schema::parse(&text)?, pattern)?;
        Ok(text)
    }

    /// The robot's own service with this key; or one that carries the struct which the caller was built with, as every
    /// module's `<module>/control` carries `ModuleControl`.
    fn own(&self, pattern: Pattern) -> Option<&'static Contract> {
        let of_pattern = || {
            let contracts = SERVICES.iter().map(|spec| &spec.contract);
            contracts.filter(move |own| own.pattern == pattern)
        };
        let is_meant = |own: &&Contract| self.layout_hash == Some(hex(own.layout_hash()).as_str());
        of_pattern()
            .find(|own| own.key == self.key)
            .or_else(|| of_pattern().find(is_meant))
    }

    /// Whether `schema` is the caller's.
    ///
    /// # Errors
    ///
    /// [`Error::Layout`] when it is not.
    fn check(&self, schema: &Schema, pattern: Pattern) -> Result<(), Error> {
        let hash = hex(pattern.layout_hash(schema));
        if self.layout_hash.is_some_and(|wanted| wanted != hash) {
            return Err(Error::Layout(format!(
                "`{}` carries `{} {hash}`, this program was built for {}: use header and library of the same version",
                self.key,
                schema.type_name(),
                self.layout_hash.unwrap_or_default(),
            )));
        }
        if self.size != 0 && self.size != schema.size() {
            return Err(Error::Layout(format!(
                "a struct of `{}` has {} bytes, that of this program has {}",
                self.key,
                schema.size(),
                self.size
            )));
        }
        Ok(())
    }

    /// Subscribes to the topic.
    ///
    /// # Errors
    ///
    /// When the topic carries something else than the caller expects.
    pub fn subscriber(&self, ipc: &Ipc) -> Result<DynamicSubscriber, Error> {
        let schema = self.schema(ipc, Pattern::PublishSubscribe)?;
        Ok(DynamicSubscriber::open(ipc, self.key, &schema)?)
    }

    /// Becomes the publisher of the topic; only that of a test has patience.
    ///
    /// # Errors
    ///
    /// See [`DynamicPublisher::open`]; a module's topic needs a schema.
    pub fn publisher(
        &self,
        ipc: &Ipc,
        patience: Option<Patience>,
    ) -> Result<DynamicPublisher, Error> {
        let text = self.text(Pattern::PublishSubscribe)?;
        Ok(DynamicPublisher::open_with(ipc, self.key, &text, patience)?)
    }

    /// A client of the request service.
    ///
    /// # Errors
    ///
    /// When the service carries something else than the caller expects.
    pub fn client(&self, ipc: &Ipc) -> Result<DynamicClient, Error> {
        let schema = self.schema(ipc, Pattern::RequestResponse)?;
        Ok(DynamicClient::open(ipc, self.key, &schema)?)
    }

    /// Whether a client that is open already sends what the caller expects.
    ///
    /// # Errors
    ///
    /// [`Error::Layout`] when it does not.
    pub fn check_client(&self, client: &DynamicClient) -> Result<(), Error> {
        self.check(client.schema(), Pattern::RequestResponse)
    }

    /// Becomes the server of the request service.
    ///
    /// # Errors
    ///
    /// See [`DynamicServer::open`]; a module's own request needs a schema.
    pub fn server(&self, ipc: &Ipc) -> Result<DynamicServer, Error> {
        let text = self.text(Pattern::RequestResponse)?;
        Ok(DynamicServer::open(ipc, self.key, &text)?)
    }
}

fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}
