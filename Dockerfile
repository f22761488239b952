# docs/commands.md has the lines that build and run it
FROM debian:trixie-slim
RUN apt-get update -q && apt-get install -y -q --no-install-recommends make
COPY Makefile setup.cfg pyproject.toml README.md LICENSE /src/
COPY fastgen /src/fastgen
COPY shaders /src/shaders
COPY assets /src/assets
RUN make -C /src VENV=/opt/fastgen install
RUN useradd fastgen && install -d -m 1777 /cache /data
ENV PATH=/opt/fastgen/bin:$PATH XDG_CACHE_HOME=/cache
USER fastgen
VOLUME /cache
WORKDIR /data
ENTRYPOINT ["fastgen"]
CMD ["doctor"]
