# Case 1 through three formats, and case 2: synth -> identify -> check. A reported error that grows fails the run.
.PHONY: demo pipelines

DEMO := build/demo
PIPELINES := build/pipelines
CASES := case1 case2
FORMATS := mcap parquet csv
ALGID := $(BIN)/algid

demo: setup
	@rm -rf $(DEMO)
	@for case in $(CASES); do \
	  $(ALGID) synth --force $$case -o $(DEMO) >/dev/null && \
	  for estimator in paper refined; do \
	    $(ALGID) identify $(DEMO)/$$case-unloaded.mcap --loaded $(DEMO)/$$case-loaded.mcap \
	      --estimator $$estimator -o $(DEMO)/$$estimator --quiet || exit; \
	  done || exit; \
	done
	@$(BIN)/python -m pipelines.table4 $(DEMO)
	@echo "Reports: $(DEMO)/refined/case1-unloaded.algid/report.html and its neighbours"

pipelines: setup $(foreach format,$(FORMATS),pipeline-case1-$(format)) pipeline-case2-mcap

define PIPELINE
.PHONY: pipeline-$(1)-$(2)
pipeline-$(1)-$(2): setup
	@echo "== $(1) $(2)"
	@rm -rf $(PIPELINES)/$(1)-$(2)
	@$(ALGID) synth --force $(1) --format $(2) -o $(PIPELINES)/$(1)-$(2) >/dev/null
	@for estimator in paper refined; do \
	  $(ALGID) identify $(PIPELINES)/$(1)-$(2)/$(1)-unloaded.$(2) \
	    --loaded $(PIPELINES)/$(1)-$(2)/$(1)-loaded.$(2) --estimator $$$$estimator \
	    -o $(PIPELINES)/$(1)-$(2)/$$$$estimator --quiet --no-report && \
	  $(ALGID) validate $(PIPELINES)/$(1)-$(2)/$$$$estimator/$(1)-unloaded.algid \
	    --max-error pipelines/tolerances/$(1)-$$$$estimator.toml || exit 1; \
	done
endef
$(foreach case,$(CASES),$(foreach format,$(FORMATS),$(eval $(call PIPELINE,$(case),$(format)))))

# The README's pictures, of a noisy pair of logs.
.PHONY: pictures
pictures: setup
	@rm -rf build/pictures
	@$(ALGID) synth --force case1 --torque wide --duration 10 --position-noise 1e-3 --torque-noise 1e-2 -o build/pictures >/dev/null
	@$(ALGID) identify build/pictures/case1-unloaded.mcap --loaded build/pictures/case1-loaded.mcap -o build/pictures -q
	$(BIN)/python -m pipelines.pictures build/pictures/case1-unloaded.algid -o data/pictures
