# syntax=docker/dockerfile:1
# planish without a Python of your own:
#   docker build -t planish .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" planish restore scan.obj -o page.tif
# --build-arg EXTRAS= leaves out the optional parts.
ARG PYTHON=3.11

FROM python:${PYTHON}-slim AS build
ARG EXTRAS=[ocr,web]
WORKDIR /src
COPY . .
# only wheels, so that no compiler is needed; the environment has no pip of its own
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels . \
 && python -m venv --without-pip /opt/planish \
 && pip --python /opt/planish/bin/python install --no-cache-dir --only-binary :all: "$(echo /wheels/planish-*.whl)${EXTRAS}"

FROM python:${PYTHON}-slim
# whichever version the distribution has is the right one
# hadolint ignore=DL3008
RUN apt-get update \
 && apt-get install -y --no-install-recommends tesseract-ocr \
 && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/planish /opt/planish
ENV PATH=/opt/planish/bin:$PATH NUMBA_CACHE_DIR=/cache
RUN useradd --create-home --uid 1000 planish \
 && mkdir /data /cache \
 && chown planish:planish /data /cache
USER 1000
# compiles the kernels once for all containers, and shows that the image works; on another kind of processor they are
# compiled again, so keep /cache (-v planish-cache:/cache) there; whoever runs the image may write to it
RUN planish demo --output /tmp/demo --quiet \
 && rm -r /tmp/demo \
 && chmod -R a+rwX /cache
VOLUME ["/data", "/cache"]
WORKDIR /data
ENTRYPOINT ["planish"]
CMD ["--help"]
