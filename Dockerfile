# The trust manager, which compose.yaml starts with its database.
FROM python:3.11-slim AS manager
WORKDIR /roletrust
COPY . .
RUN pip install --no-cache-dir --constraint constraints.txt '.[manager]'
USER nobody
ENTRYPOINT ["roletrust", "manager", "serve"]

# The environment of `make run` and `make test`: docker build -t roletrust . && docker run --rm roletrust
# Their marks are made here, so that neither installs anything when it runs.
FROM python:3.11-slim
RUN apt-get update && apt-get install --yes --no-install-recommends git make && rm -rf /var/lib/apt/lists/*
WORKDIR /roletrust
COPY . .
RUN make setup .venv/.ready-run .venv/.ready-test
CMD ["make", "run"]
